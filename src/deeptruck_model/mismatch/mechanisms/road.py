"""The road: slope and surface, as profiles along the distance driven."""

from __future__ import annotations

from collections.abc import Iterator

from deeptruck_core.constants import GRAVITY
from deeptruck_core.signals import FELT
from deeptruck_model.mismatch.mechanisms.courses import Course, along_the_road, each_drive
from deeptruck_model.mismatch.mechanisms.record import Column, Form, Mechanism, force
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import Expression, Signal, lift

HILLY = 0.02  # sd of the slope of a hilly road
ROUGH = 0.1  # m/s^2: soft ground
WET = 0.02  # m/s^2: a third of what tyres take, from one whole drive to another
SLOPE = Column(lift(-GRAVITY), HILLY, "grade", "ratio", sign=0)
FELT_SHARE = Column(-GRAVITY * Signal(FELT), 0.1, "share of the slope that was felt", mean=1.0)


def _unless_felt(e: Evidence, carrier: Expression) -> Iterator[Course]:
    """Profiles where no accelerometer says what the slope is."""
    if not e.has(FELT):
        yield from along_the_road(HILLY)(e, carrier)


ROAD_GRADE = Mechanism(
    "road_grade",
    "air_tyres_road",
    says="the road has a slope the simulator does not know",
    equation="F = -m g s(x)",
    needs=("distance",),
    depends_on=("distance along the road",),
    source="definition of grade",
    manoeuvre="drive the same section in both directions",
    forms={
        # where none was recorded it may be the same everywhere; else that is the sensor's zero
        "constant": Form(lambda: SLOPE, lambda e: () if e.has("grade") or e.has(FELT) else ({},)),
        "profile": Form(lambda: SLOPE, courses=(_unless_felt,), steady=False),
        "felt": Form(lambda: FELT_SHARE, needs=(FELT,)),
    },
    prior_with={"grade": 0.2},  # where it would show
    of_input="grade",
)

ROAD_SURFACE = Mechanism(
    "road_surface",
    "air_tyres_road",
    says="the road rolls harder, on sections or on whole drives",
    equation="F = -m c(x), c >= 0, or one c in each recording",
    needs=("distance",),
    depends_on=("distance along the road", "recording"),
    source="rolling resistance of road textures: MIRIAM project",
    manoeuvre="drive the same section in both directions",
    forms={
        # another road, or rain
        "each drive": Form(lambda: force(lift(-1.0), WET, sign=0), courses=(each_drive(more_than=2),)),
        "profile": Form(lambda: force(lift(-1.0), ROUGH), courses=(along_the_road(ROUGH),)),
    },
    prior=0.05,  # what is not the same on the next pass is any drag that is time-varying
)

MECHANISMS = (ROAD_GRADE, ROAD_SURFACE)

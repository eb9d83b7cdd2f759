"""Load: mass that changes, and mass that moves."""

from __future__ import annotations

from deeptruck_model.mismatch.mechanisms.courses import each_drive, from_standstills, slowly
from deeptruck_model.mismatch.mechanisms.record import Column, Form, Mechanism, grid
from deeptruck_model.mismatch.mechanisms.symbols import SIMULATED
from deeptruck_model.mismatch.residual.expression import Signal, Slosh

MASS = Signal("sensitivity:mass")

PAYLOAD_CHANGE = Mechanism(
    "payload_change",
    "load",
    says="the truck's mass changed between or within the recordings",
    equation="m -> m + dm from one standstill or recording on, or dm(t) as it is discharged on the way",
    needs=("sensitivity:mass",),
    depends_on=("recording", "time"),
    source="definition; mass enters as in Gillespie eq. 2-9b",
    manoeuvre="accelerate with the same torque before and after loading",
    forms={
        "loaded": Form(
            lambda: Column(MASS, 0.4, "change", "kg", per_mass=True, sign=0),
            courses=(from_standstills, each_drive(0.3, more_than=2, most=40)),
        ),
        # sprayed, spread or discharged on the way
        "discharged": Form(
            lambda: Column(MASS, 0.5, "change", "kg", per_mass=True, sign=0),
            courses=(slowly(0.5, quick=False),),
        ),
    },
    of_input="mass",
)

LOAD_SLOSH = Mechanism(
    "load_slosh",
    "load",
    says="a liquid or swinging load moves along the truck",
    equation="x'' + 2 z w x' + w^2 x = -a;  F = m_s (w^2 x + 2 z w x' + a)",
    needs=("simulated",),
    depends_on=("acceleration history",),
    source="Abramson, NASA SP-106",
    manoeuvre="brake to a stop, and wait at constant speed afterwards",
    forms={
        # from a free surface to well baffled
        "swing": Form(
            lambda frequency_hz, damping: Column(
                Slosh((SIMULATED,), frequency_hz, damping), 0.3, "mass_share"
            ),
            grid(frequency_hz=(0.15, 0.2, 0.3, 0.4, 0.55, 0.75), damping=(0.04, 0.12, 0.3)),
            units={"frequency_hz": "Hz", "damping": "1"},
            fitted={"frequency_hz": (0.1, 1.2), "damping": (0.02, 0.6)},
        ),
        # a bore that runs to and fro: several frequencies side by side
        "modes": Form(
            lambda modes_hz, damping: [
                Column(Slosh((SIMULATED,), hz, damping), 0.2, f"mass_share_at_{hz:g}_Hz") for hz in modes_hz
            ],
            grid(modes_hz=[(0.15, 0.25, 0.4, 0.6, 0.9, 1.3)], damping=(0.1,)),
            units={"damping": "1"},
        ),
    },
    prior=0.3,
)

MECHANISMS = (PAYLOAD_CHANGE, LOAD_SLOSH)

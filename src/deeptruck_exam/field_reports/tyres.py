"""Fourth forms in the tyres."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.field_reports.road import CELL_M, Mapped, windows
from deeptruck_exam.hidden import GRAVITY, Array, Hidden, hidden, moving, weight
from deeptruck_model.trucks import View


@hidden(
    "coastdown_polynomial",
    name="rolling_resistance_speed",
    forms="fourth",
    source="SAE J2452: rolling resistance as a power of inflation times a power of load times a + bV + cV2;"
    " a step of speed is answered at once, and relaxes over minutes as the tyre warms (ISO 18164 asks for a"
    " steady one); soft tyres, sizes chosen here",
    ranges={
        "linear": (0.0018, 0.0045),  # of the weight, for 10 m/s
        "square": (0.0008, 0.0020),
        "pressure": (0.7, 0.95),
        "relaxes": (0.1, 0.3),
        "after_s": (40.0, 120.0),
    },
    needs=("highway", "hills"),
    accepts=("drag_area", "rolling_resistance"),
)
class CoastdownPolynomial(Hidden):
    def prepare(self) -> None:
        self.soft = self.p.pressure**-0.45

    def start(self, batch: int) -> dict[str, Array]:
        return {"steady": np.full(batch, 10.0)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        speed = np.clip(view.speed, 0.0, 32.0)
        s.steady += dt * (speed - s.steady) / p.after_s
        pace = speed / 10.0
        warm = 1.0 - p.relaxes * np.clip(s.steady / 20.0, 0.0, 1.2)
        heavy = np.clip(view.mass / 2.0e4, 0.4, 2.0) ** -0.1  # a power of load below one
        growth = self.soft * heavy * warm * (p.linear * pace + p.square * pace**2)
        return -growth * weight(view)


@hidden(
    "warmed_by_the_way",
    name="rolling_resistance_warmup",
    forms="fourth",
    source="Rolling resistance falls over kilometres, fast at first and then ever slower, as coastdown"
    " practice finds (SAE J1263 and 40 CFR 1066 on warm-up); a stretched exponential of the way (Kohlrausch)"
    " from the temperature of the night, with ISO 28580's temperature factor; sizes are chosen here",
    ranges={
        "cold": (1.9, 3.4),  # of the known resistance, at -15 C
        "way_m": (500.0, 1800.0),
        "stretch": (0.45, 0.75),
        "night_c": (-20.0, 0.0),
    },
)
class WarmedByTheWay(Hidden):
    """Neither speed nor time warms these tyres, the way does; some have come a way already."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(370), self.setting.batch
        night = self.p.night_c + rng.uniform(0.0, 10.0, batch)
        self.cold = self.p.cold * np.clip((25.0 - night) / 40.0, 0.15, 1.0)
        self.before_m = self.p.way_m * rng.choice([0.0, 0.0, 1.0, 4.0], batch)

    def newtons(self, view: View, dt: float) -> Array:
        way = (np.maximum(view.distance, 0.0) + self.before_m) / self.p.way_m
        left = np.exp(-(way**self.p.stretch))
        return -self.cold * left * self.truck.rolling_resistance * weight(view) * moving(view)


@hidden(
    "one_wheel_on_ice",
    name="wheel_slip",
    forms="fourth",
    source="Split friction and an open differential: both wheels carry what the worse one can, plus what the"
    " slip control brakes on the spinning wheel (Automotive Handbook, Bosch, on traction control of heavy"
    " vehicles); antilock systems that choose the lower side; where the ice lies and sizes are chosen here",
    ranges={"ice": (0.05, 0.10), "brakes": (0.3, 0.7), "finds_s": (1.0, 3.0), "share_of_road": (0.25, 0.5)},
    needs=("suburban", "hills"),
)
class OneWheelOnIce(Mapped):
    """brakes: of the difference to dry grip, reached after finds_s."""

    def prepare(self) -> None:
        rng = self.setting.rng(371)
        self.road = windows(rng, self.rows(), 160.0, self.p.share_of_road)

    def start(self, batch: int) -> dict[str, Array]:
        return {"helps": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        icy = self.here(view) > 0.0
        axle = self.truck.drive_axle_share * weight(view) * (1.0 + 0.3 * view.grade)
        pull = np.maximum(view.traction_force, 0.0)
        low = (p.ice + 0.25 * p.brakes * s.helps) * axle
        spins = icy & (pull > low)
        s.helps = np.clip(s.helps + dt * np.where(spins, 1.0, -0.5) / p.finds_s, 0.0, 1.0)
        lost = np.maximum(pull - low, 0.0) * icy
        held = np.maximum(view.brake_force - (0.5 * p.ice + 0.07) * weight(view), 0.0) * icy
        return held * moving(view) - lost


@hidden(
    "lost_between_map_points",
    name="road_grade",
    forms="fourth",
    gateable=False,
    source="Slopes of a road map are straight between its points (ADASIS v2 and v3 slope profiles), and the"
    " road is not: heights between two points wander as a Brownian bridge, after the spectrum of long waves"
    " of ISO 8608 (waviness 2); spacings and sizes of an old map, chosen here",
    ranges={"slope": (0.011, 0.021), "points_m": (250.0, 700.0), "smooth_m": (50.0, 110.0)},
    needs=("hills", "highway", "suburban"),
    accepts=("road_surface",),
)
class LostBetweenMapPoints(Mapped):
    """The height is right at every point of the map."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, rows = self.setting.rng(372), self.rows()
        width = max(2, round(self.p.smooth_m / CELL_M))
        wander = np.cumsum(rng.standard_normal((rows, self.cells)), axis=1)
        points = round(self.p.points_m / CELL_M)
        cells = np.arange(self.cells)
        at = np.arange(0, self.cells + points, points).clip(max=self.cells - 1)
        height = np.stack([row - np.interp(cells, at, row[at]) for row in wander])
        kernel = np.ones(width) / width
        smooth = np.stack([np.convolve(row, kernel, mode="same") for row in height])
        slope = np.gradient(smooth, axis=1)
        self.road = self.p.slope * np.clip(slope / slope.std(), -2.5, 2.5)

    def newtons(self, view: View, dt: float) -> Array:
        return -self.setting.direction * self.here(view) * view.mass * GRAVITY * moving(view)

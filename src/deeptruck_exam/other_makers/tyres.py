"""Third forms between tyre and road."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, place, weight
from deeptruck_model.trucks import View

CELL_M = 5.0
CELLS = 12000


def sections(rng: np.random.Generator, rows: int, mean_m: float) -> NDArray[np.int64]:
    """(rows, CELLS) numbers of the section a cell lies in; lengths are log-normal about `mean_m`."""
    out = np.zeros((rows, CELLS), np.int64)
    for row in out:
        lengths = mean_m * rng.lognormal(-0.1, 0.45, CELLS)
        ends = np.cumsum(np.maximum(lengths, 60.0))
        row[:] = np.searchsorted(ends, (np.arange(CELLS) + 0.5) * CELL_M)
    return out


class AtPlace(Hidden):
    """`road` (routes, CELLS) read where the truck is, whichever way it drives."""

    road: Array

    def here(self, view: View) -> Array:
        cell = (place(self.setting, view) / CELL_M).astype(int) % CELLS
        return np.asarray(self.road[self.setting.route, cell])

    def rows(self) -> int:
        return int(self.setting.route.max()) + 1


@hidden(
    "linear_and_fourth_power",
    name="rolling_resistance_speed",
    forms="third",
    source="Mitschke and Wallentowitz, Dynamik der Kraftfahrzeuge (2014): rolling resistance coefficient as"
    " constant, linear and fourth power of speed over 100 km/h; sizes of soft cross-ply tyres, chosen here",
    ranges={"linear": (0.0035, 0.0080), "fourth": (0.006, 0.014)},
    needs=("highway", "hills"),
    accepts=("drag_area", "rolling_resistance"),
)
class LinearAndFourthPower(Hidden):
    def newtons(self, view: View, dt: float) -> Array:
        pace = np.clip(view.speed / 27.78, 0.0, 1.3)
        return -(self.p.linear * pace + self.p.fourth * pace**4) * weight(view)


@hidden(
    "axle_by_axle",
    name="rolling_resistance_warmup",
    forms="third",
    source="Wong, Theory of Ground Vehicles (2008), on rolling resistance and tyre temperature: loss in"
    " inverse proportion to warmth, which follows a balance that rises with speed; axles that warm at their"
    " own pace are chosen here",
    ranges={"warm_k": (28.0, 45.0), "per_k": (0.012, 0.0185), "pace_s": (110.0, 320.0)},
)
class AxleByAxle(Hidden):
    """warm_k: above the air at 20 m/s. A slow stretch lets tyres cool again."""

    def prepare(self) -> None:
        self.load = np.array([[0.25], [0.35], [0.40]])
        self.pace = self.p.pace_s * np.array([[0.6], [1.0], [1.5]])
        self.first = self.setting.rng(250).uniform(0.0, 0.5, self.setting.batch) * self.p.warm_k

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": np.tile(self.first, (3, 1))}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        balance = p.warm_k * np.minimum(np.maximum(view.speed, 0.0) / 20.0, 1.0) ** 0.6
        s.warm += dt * (balance - s.warm) / self.pace
        growth = 1.0 / (1.0 - p.per_k * (p.warm_k - s.warm)) - 1.0
        extra = (self.load * growth).sum(axis=0) * self.truck.rolling_resistance
        return -extra * weight(view) * moving(view)


@hidden(
    "soft_ground",
    name="road_surface",
    forms="third",
    source="Louhghalam, Akbarian and Ulm, Scaling Relationships of Dissipation-Induced Pavement-Vehicle"
    " Interactions, Transportation Research Record 2457 (2014): a viscous road costs the more the slower"
    " one drives; classes from concrete to unbound ground, sizes chosen here",
    ranges={"loss": (0.012, 0.028), "half_mps": (6.0, 14.0), "mean_m": (350.0, 900.0)},
    accepts=("road_grade",),
)
class SoftGround(AtPlace):
    """loss: over weight at walking pace on the softest."""

    def prepare(self) -> None:
        rng = self.setting.rng(251)
        number = sections(rng, self.rows(), self.p.mean_m)
        classes = rng.choice([0.0, 0.0, 0.45, 1.0], (self.rows(), int(number.max()) + 1))
        self.road = np.take_along_axis(classes, number, axis=1)

    def newtons(self, view: View, dt: float) -> Array:
        slow = self.p.half_mps / (self.p.half_mps + np.maximum(view.speed, 0.0))
        return -self.p.loss * self.here(view) * slow * weight(view) * moving(view)


@hidden(
    "tangents_not_in_the_map",
    name="road_grade",
    forms="third",
    gateable=False,
    source="Vertical alignment of straight grades joined by parabolas, AASHTO, A Policy on Geometric Design"
    " of Highways and Streets: the recorded grade lacks every second one, as of a map before the road was"
    " rebuilt; slopes and lengths chosen here",
    ranges={"slope": (0.014, 0.028), "mean_m": (300.0, 800.0)},
    needs=("hills", "highway", "suburban"),
    accepts=("road_surface",),
)
class TangentsNotInTheMap(AtPlace):
    """Steps of slope with ramps of 100 m between; the height they gain is kept."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng = self.setting.rng(252)
        number = sections(rng, self.rows(), self.p.mean_m)
        size = rng.uniform(0.6, 1.4, (self.rows(), int(number.max()) + 1))
        slopes = self.p.slope * size * rng.choice([-1.0, 0.0, 1.0], size.shape, p=[0.35, 0.3, 0.35])
        steps = np.take_along_axis(slopes, number, axis=1)
        self.road = np.stack([np.convolve(row, np.ones(20) / 20.0, mode="same") for row in steps])

    def newtons(self, view: View, dt: float) -> Array:
        return -self.setting.direction * self.here(view) * weight(view) * moving(view)


@hidden(
    "film_on_the_road",
    name="wheel_slip",
    forms="third",
    source="Wet friction falling exponentially with sliding speed (PIARC model, Wambold and others, 1995);"
    " smooth saturation of a brush tyre (Pacejka, Tyre and Vehicle Dynamics, 2012); leaves or diesel that"
    " lie from a moment of the drive on, chosen here",
    ranges={"friction": (0.11, 0.20), "scale_mps": (25.0, 50.0), "share_of_time": (0.4, 0.8)},
    needs=("suburban", "hills"),
    accepts=("torque_limit",),
)
class FilmOnTheRoad(Hidden):
    """Pull and brake force are squeezed below the grip before they reach it."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(253), self.setting.batch
        self.from_s = (1.0 - self.p.share_of_time) * rng.uniform(0.0, 1.6, batch) * self.setting.duration_s

    def newtons(self, view: View, dt: float) -> Array:
        wet = np.clip((view.time - self.from_s) / 8.0, 0.0, 1.0)
        grip = self.p.friction * np.exp(-np.maximum(view.speed, 0.0) / self.p.scale_mps) * weight(view)
        driven = self.truck.drive_axle_share * grip
        pull = np.maximum(view.traction_force, 0.0)
        braked = view.brake_force - 1.2 * grip * np.tanh(view.brake_force / (1.2 * grip))
        return wet * (braked * moving(view) - (pull - driven * np.tanh(pull / driven)))

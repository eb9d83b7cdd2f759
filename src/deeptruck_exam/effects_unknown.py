"""Effects for which no library name exists: the right answer is 'unknown'. Air, road, tyres and trailer."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, ou_series, weight
from deeptruck_model.trucks import View


@hidden(
    "cornering_scrub",
    name="unknown",
    source="Mitschke and Wallentowitz, Dynamik der Kraftfahrzeuge (2014): curve resistance with lateral"
    " force squared over cornering stiffness; scrub of a tandem with curvature alone is chosen here",
    ranges={"stiffness_n": (1.2e6, 2.5e6), "tandem": (3.0, 8.0), "sharpest": (0.015, 0.035)},
    needs=("suburban", "hills"),
)
class CurveResistance(Hidden):
    """sharpest: 1/m at walking pace; drivers keep lateral acceleration below 2.5 m/s2."""

    def prepare(self) -> None:
        noise = ou_series(
            self.setting.rng(30), (self.setting.batch, int(self.setting.duration_s) + 2), 1.0, 6.0
        )
        self.bend = np.maximum(np.abs(noise) - 0.7, 0.0)

    def newtons(self, view: View, dt: float) -> Array:
        bend = self.bend[:, min(int(view.time), self.bend.shape[1] - 1)]
        curvature = np.minimum(self.p.sharpest * bend, 2.5 / np.maximum(view.speed, 3.0) ** 2)
        lateral = view.mass * view.speed**2 * curvature
        scrub = self.p.tandem * 0.7 * weight(view) * curvature * 0.08
        return -(lateral**2 / self.p.stiffness_n + scrub) * moving(view)


@hidden(
    "snow_ploughing",
    name="unknown",
    source="Shoop, Richmond and Lacombe, Overview of Cold Regions Mobility Modeling at CRREL, J."
    " Terramechanics 43 (2006): resistance of snow with depth; the part with speed squared and the snowfall"
    " are chosen here",
    ranges={"compaction_n": (300.0, 1000.0), "plough": (1.5, 5.0), "deeper_per_min": (0.15, 0.45)},
)
class Snow(Hidden):
    def prepare(self) -> None:
        self.first = self.setting.rng(31).uniform(0.0, 0.8, self.setting.batch)

    def newtons(self, view: View, dt: float) -> Array:
        depth = self.first + self.p.deeper_per_min * view.time / 60.0
        wide = weight(view) / 2.0e5  # a heavier truck has more tyres in the snow
        force = self.p.compaction_n * depth**2 + self.p.plough * depth * view.speed**2
        return -wide * force * moving(view)


@hidden(
    "trailer_sway",
    name="unknown",
    source="Self-excited yaw oscillation of trailers above a critical speed (Troger and Zeman, Vehicle"
    " System Dynamics 13, 1984), as a van der Pol oscillator; drag with the square of the angle is chosen"
    " here",
    ranges={"critical_mps": (17.0, 21.0), "hz": (0.35, 0.6), "drag_n": (2500.0, 6000.0)},
    needs=("highway",),
    trucks=("trucksim", "volvo"),
)
class Sway(Hidden):
    def prepare(self) -> None:
        self.kick = ou_series(
            self.setting.rng(32), (self.setting.batch, int(self.setting.duration_s / 0.1) + 20), 0.1, 0.5
        )

    def start(self, batch: int) -> dict[str, Array]:
        return {"angle": np.full(batch, 0.05), "rate": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        omega = 2.0 * np.pi * p.hz
        growth = 0.12 * np.clip((view.speed - p.critical_mps) / 3.0, -2.0, 1.0)
        kick = 1.2 * self.kick[:, min(int(view.time / 0.1), self.kick.shape[1] - 1)]
        s.rate += dt * (-(omega**2) * s.angle + 2.0 * omega * (growth - 0.25 * s.angle**2) * s.rate + kick)
        s.angle = np.clip(s.angle + dt * s.rate, -1.5, 1.5)
        return -p.drag_n * s.angle**2 * moving(view)


@hidden(
    "wake_bistability",
    name="unknown",
    source="Grandemange, Gohlke and Cadot, J. Fluid Mech. 722 (2013): the wake of a blunt body has two"
    " states; their drag difference and the hysteresis in speed are exaggerated here",
    ranges={
        "low_drag": (0.30, 0.50),
        "up_mps": (19.0, 22.0),
        "hysteresis_mps": (3.0, 6.0),
        "mean_s": (15.0, 40.0),
    },
    needs=("highway",),
)
class TwoWakes(Hidden):
    def prepare(self) -> None:
        rng = self.setting.rng(33)
        samples = int(self.setting.duration_s / 0.1) + 20
        self.flip = rng.random((self.setting.batch, samples)) < 0.1 / self.p.mean_s

    def start(self, batch: int) -> dict[str, Array]:
        return {"attached": np.zeros(batch), "seen": np.full(1, -1.0)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        at = min(int(view.time / 0.1), self.flip.shape[1] - 1)
        if at != s.seen[0]:
            s.seen[0] = at
            s.attached = np.where(self.flip[:, at], 1.0 - s.attached, s.attached)
        s.attached = np.where(view.speed < p.up_mps - p.hysteresis_mps, 0.0, s.attached)
        return p.low_drag * s.attached * view.drag_force


@hidden(
    "tyre_pressure_loss",
    name="unknown",
    source="Rolling loss with a power of pressure, as corrections in ISO 28580 take it; a leak over"
    " distance and the flexing of a flat tyre of a pair are chosen here",
    ranges={"gain": (0.8, 1.8), "leak_m": (900.0, 2500.0), "puncture_share": (0.1, 0.5)},
)
class SlowPuncture(Hidden):
    def prepare(self) -> None:
        self.from_m = (
            self.setting.rng(34).uniform(0.0, 2.0, self.setting.batch) * 2500.0 * self.p.puncture_share
        )

    def newtons(self, view: View, dt: float) -> Array:
        since = np.maximum(view.distance - self.from_m, 0.0)
        pressure = 0.12 + 0.88 * np.exp(-since / self.p.leak_m)
        growth = self.p.gain * (pressure**-0.6 - 1.0)
        return -growth * self.truck.rolling_resistance * weight(view) * moving(view)


@hidden(
    "hitch_spring",
    name="unknown",
    source="Two masses on a spring with free play, fore and aft: textbook vibration of a towed vehicle;"
    " frequency and damping are chosen here",
    ranges={
        "trailer_share": (0.2, 0.4),
        "hz": (0.9, 1.8),
        "damping": (0.06, 0.15),
        "play_m": (0.002, 0.012),
    },
    needs=("suburban",),
    trucks=("trucksim", "volvo"),
)
class Drawbar(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        return {"stretch": np.zeros(batch), "rate": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        omega = 2.0 * np.pi * p.hz
        elastic = np.sign(s.stretch) * np.maximum(np.abs(s.stretch) - p.play_m, 0.0)
        turning = -(omega**2) * elastic - 2.0 * p.damping * omega * s.rate - view.acceleration
        s.rate += dt * turning
        s.stretch = np.clip(s.stretch + dt * s.rate, -0.4, 0.4)
        return -p.trailer_share * view.mass * np.clip(turning, -3.0, 3.0) * moving(view)

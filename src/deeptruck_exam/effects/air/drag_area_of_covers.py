"""Sheets, covers, nets, hatches, louvres, vanes, branches and pipes that change their drag."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series, some_drives
from deeptruck_model.trucks import View

law = partial(hidden, name="drag_area", accepts="headwind rolling_resistance_speed")


@law("drag_area", "first", "highway hills")
@sizes(gain=(0.25, 0.60), flutter=(0.02, 0.06), share_of_drives=(0.4, 0.7))
class LooseTarpaulin(Hidden):
    """In some recordings, from their beginning or from a moment on.
    Source: Add-on and loose parts change the drag of trucks, Hucho, Aerodynamics of Road Vehicles (1998);
    sizes and the broad-band flutter are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(2)
        batch, duration = self.setting.batch, self.setting.duration_s
        drives = some_drives(rng, batch, self.p.share_of_drives)
        moment = np.where(rng.random(batch) < 0.5, -1.0, rng.uniform(0.2, 0.6, batch) * duration)
        self.from_s = np.where(drives, moment, np.inf)
        self.flutter = ou_series(rng, (batch, int(duration / 0.05) + 40), 0.05, 0.3)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = index(view, self.flutter, 0.05)
        gain = p.gain + p.flutter * self.flutter[:, at]
        return np.where(view.time >= self.from_s, -gain * view.drag_force, 0.0)


@law("tearing_cover", "second", "highway hills")
@sizes(gain=(0.45, 0.95), from_mps=(13.0, 17.0), tear_s=(20.0, 60.0), torn_before=(0.0, 0.5))
class TearingCover(Hidden):
    """Tears only while driven fast, and never mends; drives start with the tear of the evening before.
    Source: Drag of loose fabric by its area in the stream: Hoerner, Fluid-Dynamic Drag (1965), on flags and
    surface irregularities; tearing with the excess of dynamic pressure is chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"torn": self.p.torn_before * self.rng(103).integers(0, 2, batch).astype(float)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        excess = np.clip((view.speed / p.from_mps) ** 2 - 1.0, 0.0, 1.5)
        s.torn += dt * excess * (1.0 - s.torn) / p.tear_s
        return -p.gain * s.torn * view.drag_force


@law("empty_open_body", "fifth", "highway hills")
@sizes(gain=(0.28, 0.5), breathes=(0.1, 0.45), from_mps=(12.0, 17.0), rolled_back=(0.3, 0.6))
class EmptyOpenBody(Hidden, breath=0.0):
    """Empty on the way back, and on some ways out. The simulator knows the truck with its sheet drawn.
    Source: Storms, Salari and Babb, Fuel Savings and Aerodynamic Drag Reduction from Rail Car Covers, NASA
    TM-2008-214583: an empty open body has far more drag than a full or a covered one; the cavity begins to
    breathe above a speed (Rossiter, ARC R&M 3438, 1964); sizes of tippers, chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(403), self.setting.batch
        empty = (self.setting.direction < 0) | (rng.random(batch) < self.p.rolled_back)
        empty[batch - 1] = True
        self.empty = empty * rng.uniform(0.85, 1.1, batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        # it starts at a speed and stops a little below
        begins = p.from_mps - 1.5 * (s.breath > 0.5)
        s.breath += dt * ((view.speed > begins) - s.breath) / 2.0
        return -self.empty * (p.gain + p.breathes * s.breath) * view.drag_force


@law("cover_fills_like_a_canopy", "seventh", "highway hills", accepts="headwind")
@sizes(gain=(0.5, 0.95), fills_m=(120.0, 420.0), from_mps=(14.0, 18.0), slower=(0.16, 0.4))
class CoverFillsLikeACanopy(Hidden, way=0.0, slows=0.0):
    """`way` filled, of fills_m; area with its square. gain: of the drag area, filled; slower: m/s2 of slowing
    at which its wake overtakes it.
    Source: Knacke, Parachute Recovery Systems Design Manual (1992): a canopy fills within a number of its
    lengths at any speed and collapses when its wake overtakes it; a curtain off its rail."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.slows += dt * (np.clip(view.acceleration, -3.0, 3.0) - s.slows) / 0.8
        fills = (view.speed > p.from_mps) & (s.slows > -p.slower)
        change = np.where(fills, view.speed / p.fills_m, -s.way / 3.0)
        s.way = np.clip(s.way + dt * change, 0.0, 1.0)
        return -p.gain * s.way**2 * view.drag_force


@law("n_hatch_lifts", "ninth", "highway hills", accepts="rolling_resistance_speed")
@sizes(gain=(0.65, 1.15), lifts_mps=(13.0, 18.0), falls=(0.72, 0.92), swings_s=(0.6, 2.0), loose=(0.4, 0.75))
class HatchLifts(Hidden, up=0.0):
    """`up`: sine of its angle. gain: of the drag area, upright; falls: speed over that at which it lifts;
    loose: share of drives on which it was not latched.
    Source: Moments about a hinge: suction over a roof grows with speed squared (Hucho, Aerodynamics of Road
    Vehicles, 1998, on pressures), weight holds by the cosine; once in the stream it stays up longer. Sizes
    of an unlatched roof hatch are chosen here."""

    def prepare(self) -> None:
        self.loose = some_drives(self.rng(903), self.setting.batch, self.p.loose)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lifts = p.lifts_mps * (1.0 - (1.0 - p.falls) * np.clip(2.0 * s.up, 0.0, 1.0))
        cosine = np.clip((lifts / np.maximum(view.speed, 1.0)) ** 2, 0.0, 1.0)
        s.up = s.up + dt * (np.sqrt(1.0 - cosine**2) - s.up) / p.swings_s
        return -p.gain * s.up * self.loose * view.drag_force


@law("t_cloth_flaps", "tenth", "highway", accepts="rolling_resistance_speed")
@sizes(more=(0.4, 0.75), from_mps=(18.0, 21.5), until=(0.82, 0.93), gathers_s=(1.5, 6.0))
class ClothFlaps(Hidden, flaps=0.0, size=0.0):
    """A loose cover lies still up to a speed, flaps beyond it, and lies down only well below. more: of the
    drag; until: of from_mps.
    Source: Zhang, Childress, Libchaber and Shelley, Flexible Filaments in a Flowing Soap Film as a Model for
    One-Dimensional Flags in a Two-Dimensional Wind, Nature 408 (2000): both states are stable between two
    speeds; drag of flags after Hoerner, Fluid-Dynamic Drag (1965); sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.flaps = np.where(view.speed > p.from_mps, 1.0, s.flaps)
        s.flaps = np.where(view.speed < p.until * p.from_mps, 0.0, s.flaps)
        s.size = s.size + dt * (s.flaps - s.size) / p.gathers_s
        return -p.more * s.size * view.drag_force * moving(view)


@law("v_chaff_fills_the_net", "sixteenth", "highway hills", accepts="headwind")
@sizes(more=(1.4, 2.1), fills_m=(150.0, 500.0), solid=(1.0, 1.5), bears=(0.55, 0.95), shakes_mps2=(0.5, 1.0))
class ChaffFillsTheNet(Hidden):
    """`shut`: of the meshes of a net over loose straw. The wind of driving presses chaff into them, and the
    net turns from a sieve into a wall. What has been pressed in falls out when the driver brakes, or of
    itself where it has grown too thick. more: of the drag, all shut; solid: power of that with `shut`;
    shakes_mps2: of braking, that frees it in two seconds.
    Source: Hoerner, Fluid-Dynamic Drag (1965), on screens and their solidity, and Laws and Livesey, Flow
    Through Screens, Annual Review of Fluid Mechanics 10 (1978); chaff and sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"shut": self.rng(1602).uniform(0.0, 0.9, batch), "drops": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.drops = np.where(s.shut > p.bears, 1.0, np.where(s.shut < 0.15, 0.0, s.drops))
        shakes = np.clip(-view.acceleration / p.shakes_mps2, 0.0, 2.0) ** 2 / 2.0
        presses = speed / p.fills_m * np.clip(speed / 15.0, 0.0, 1.5)
        s.shut = np.clip(
            s.shut + dt * (presses * (1.0 - s.drops) - (shakes + 0.5 * s.drops) * s.shut), 0.0, 1.0
        )
        return -p.more * s.shut**p.solid * view.drag_force * moving(view)


@law("y_louvres_open_with_heat", "eighteenth", "hills highway suburban", accepts="headwind")
@sizes(more=(0.9, 1.4), heats_s=(4.0, 10.0), cools_s=(10.0, 25.0), opens=(0.35, 0.55), shuts=(0.12, 0.25))
@sizes(moves_s=(1.5, 5.0))
class LouvresOpenWithHeat(Hidden, open=0.0):
    """`heat` of the coolant, which engine power gives and the wind of driving takes. Louvres before the
    cooler open by three steps. Each opens at one heat and shuts again at a much lower one. more: of the drag,
    all open; opens, shuts: heat of the first step.
    Source: Hucho, Aerodynamics of Road Vehicles (1998), on drag of cooling air, and Bosch Automotive Handbook
    (2014), on radiator shutters; large louvres, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        heat = self.rng(1803).uniform(0.1, 0.9, batch)
        steps = np.array([np.zeros(batch), np.zeros(batch), np.zeros(batch)])
        return {**super().start(batch), "heat": heat, "steps": steps}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        cooling = 0.3 + 0.7 * np.clip(view.speed / 20.0, 0.0, 1.4) * (0.4 + 0.6 * s.open)
        heats = 1.6 * self.power_share(view) / p.heats_s
        s.heat = np.clip(s.heat + dt * (heats - s.heat * cooling / p.cools_s), 0.0, 1.5)
        later = np.array([[0.0], [0.2], [0.4]])
        s.steps = np.where(s.heat > p.opens + later, 1.0, np.where(s.heat < p.shuts + later, 0.0, s.steps))
        s.open = eased(s.open, s.steps.mean(axis=0), p.moves_s, dt)
        return -p.more * s.open * view.drag_force * moving(view)


@law("h_vanes_turn_in_the_wind", "nineteenth", "hills highway suburban", accepts="headwind")
@sizes(more=(1.7, 2.8), carries=(0.3, 0.5), turns_s=(8.0, 20.0), starts_mps=(9.0, 14.0), runs_s=(15.0, 50.0))
class VanesTurnInTheWind(Hidden, rim=0.0):
    """`rim` m/s of vanes on the roof, which air a load by turning in the wind of driving. Standing, they hold
    the wind like a cup, and turning with it they hold little. Rust holds them until the wind is fast enough,
    and once they turn they run on for long. more: of the drag, standing vanes; carries: of the wind's speed,
    that the rim reaches; turns_s: at 20 m/s.
    Source: Hoerner, Fluid-Dynamic Drag (1965), on cups and turbines by their ratio of speeds, and Savonius,
    The S-Rotor and Its Applications, Mechanical Engineering 53 (1931); sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"rim": self.rng(1903).uniform(0.0, 12.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wind = np.maximum(view.speed, 0.0)
        loose = np.where((wind > p.starts_mps) | (s.rim > 1.0), 1.0, 0.0)
        lags = p.carries * wind - s.rim
        gains = np.where(lags > 0.0, lags * wind / (20.0 * p.turns_s), lags / p.runs_s)
        s.rim = np.maximum(s.rim + dt * (loose * gains - 0.1 * np.minimum(s.rim, 1.0)), 0.0)
        slips = np.clip(1.0 - s.rim / np.maximum(wind, 1.0), 0.0, 1.0)
        return -p.more * slips**2 * view.drag_force * moving(view)


@law("b_brushwood_folds_back", "twentieth", "highway hills suburban", accepts="headwind")
@sizes(more=(2.8, 4.2), power=(0.9, 1.5), bends_mps=(7.0, 11.0), folds_s=(4.0, 10.0), rises_s=(20.0, 60.0))
@sizes(leaves_m=(700.0, 2200.0))
class BrushwoodFoldsBack(Hidden):
    """Brushwood stands out of an open body. Branches fold back in the wind of driving, so that their area
    falls with a power of speed, at once when it grows and slowly as it goes. `leaves` on them are torn off
    along the way, the faster the sooner. more: of the drag, unfolded and leafy; power: of the speed;
    leaves_m: at 20 m/s.
    Source: Vogel, Drag and Reconfiguration of Broad Leaves in High Winds, J. Experimental Botany 40 (1989),
    on the power; a heap of branches, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(2002)
        return {"wind": rng.uniform(4.0, 16.0, batch), "leaves": rng.uniform(0.4, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.wind = eased(s.wind, speed, np.where(speed > s.wind, p.folds_s, p.rises_s), dt)
        tears = speed / p.leaves_m * np.minimum(speed / 20.0, 1.4) ** 3
        s.leaves = np.maximum(s.leaves * (1.0 - dt * tears), 0.0)
        area = (1.0 + (s.wind / p.bends_mps) ** 2) ** (-0.5 * p.power) * (0.45 + 0.55 * s.leaves)
        return -p.more * area * view.drag_force * moving(view)


@law("u_pipes_sing", "twenty-first", "suburban hills highway", accepts="headwind")
@sizes(more=(1.9, 3.0), at_mps=(10.0, 12.5), band=(0.1, 0.17), second=(0.6, 0.9), grows_s=(1.5, 4.0))
@sizes(holds=(0.1, 0.25))
class PipesSing(Hidden, swings=0.0):
    """Pipes stand upright on the truck, and eddies leave them by turns. Where these come as fast as the pipes
    like to swing, both lock together, and the drag of a swinging pipe is a multiple of a still one. `swings`:
    of the most. A swing that is there holds on to a higher speed. The pipes have a second tone. more: of the
    drag, at full swing; at_mps: of the first tone; band: of that speed; second: swing of the second tone.
    Source: Blevins, Flow-Induced Vibration (1990), on lock-in and the drag of swinging cylinders; slender
    pipes, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wind = np.maximum(view.speed, 0.0) / p.at_mps
        late = 1.0 + p.holds * s.swings
        first = np.exp(-(((wind / late - 1.0) / p.band) ** 2))
        other = p.second * np.exp(-(((wind / late / 1.72 - 1.0) / p.band) ** 2))
        s.swings = eased(s.swings, np.maximum(first, other), p.grows_s, dt)
        return -p.more * (0.12 + 0.88 * s.swings) * view.drag_force * moving(view)

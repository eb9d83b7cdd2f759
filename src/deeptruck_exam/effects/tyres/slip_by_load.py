"""Wheels that slip because their axle has lost its load."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="wheel_slip")


@law("y_front_wheels_lose_their_load", "eighteenth", "suburban hills")
@sizes(grip=(0.3, 0.4), front=(0.24, 0.34), lifts=(1.0, 1.6), mean_m=(120.0, 450.0), share=(0.5, 0.75))
@sizes(slides=(0.1, 0.3))
class FrontWheelsLoseTheirLoad(OnRoad, lost=0.0, load=0.3):
    """Only the front wheels drive. Pull and slope both move load to the rear, and so take away the grip by
    which the front pulls. `load` of the front, which follows by the nodding of the truck. On wet stretches it
    slips. grip: of the load on it; front: of the weight, level; lifts: load lost, over pull and slope;
    slides: of the grip, lost in sliding.
    Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on traction limits of driven front axles by
    transfer of load; a short, high truck, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1871), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration / GRAVITY + view.grade, -0.2, 0.2)
        s.load = eased(s.load, np.clip(p.front - p.lifts * felt, 0.05, 0.5), 0.35, dt)
        pull = np.maximum(view.traction_force, 0.0)
        over = np.maximum(pull / (p.grip * s.load * weight(view)) - 0.8, 0.0)
        holds = p.grip * s.load * weight(view) * (0.8 + (1.0 - p.slides) * 0.25 * np.tanh(4.0 * over))
        lacks = np.maximum(pull - holds, 0.0) * np.where(over > 0.0, 1.0, 0.0)
        s.lost = eased(s.lost, self.between(self.road, view) * lacks, 0.2, dt)
        return -np.minimum(s.lost, pull) * moving(view)


@law("u_driven_axle_hangs_in_sags", "twenty-first", "hills suburban", accepts="driveline_loss")
@sizes(grip=(0.055, 0.085), lifts=(60.0, 130.0), along_m=(12.0, 25.0), falls=(0.2, 0.4), spins_s=(0.3, 0.8))
class DrivenAxleHangsInSags(Hidden, slope=9.0, spins=0.0):
    """Front axle and trailing axle are on stiff springs, and the driven one is between them: in a sag it
    hangs and slips at a small pull, on a crest it is pressed down and holds. Once it spins it holds less.
    `slope`: of the road, along_m behind. grip: pull over weight that an even road bears; lifts: of the load,
    for a bend of the road by 1/m; falls: of the grip, lost while it spins.
    Source: Fancher, Ervin, Winkler and Gillespie, A Factbook of the Mechanical Properties of the Components
    for Single-Unit and Articulated Heavy Trucks (1986), on loads of axle groups; a slippery road, sizes are
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.5)
        s.slope = np.where(s.slope > 1.0, view.grade, eased(s.slope, view.grade, p.along_m / speed, dt))
        bend = (view.grade - s.slope) / p.along_m
        load = np.clip(1.0 - p.lifts * 10.0 * bend, 0.3, 1.5)
        holds = p.grip * load * (1.0 - p.falls * s.spins) * weight(view)
        pull = np.maximum(view.traction_force, 0.0)
        over = np.maximum(pull - holds, 0.0)
        s.spins = eased(s.spins, np.clip(4.0 * over / np.maximum(pull, 1.0), 0.0, 1.0), p.spins_s, dt)
        return -over * moving(view)

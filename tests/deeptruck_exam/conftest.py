"""Hidden laws along real drives, and alone in a made-up moment."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest

from deeptruck_exam import trucks
from deeptruck_exam.construction import build
from deeptruck_exam.effects import EFFECTS
from deeptruck_exam.hidden import Setting
from deeptruck_exam.plans import draw_plan
from deeptruck_model import trucks as pool


class Listener:
    """A force that tells what it does; copies share the log."""

    def __init__(self, inner, log):
        self.inner, self.log = inner, log

    def reset(self, batch):
        self.inner.reset(batch)

    def force(self, view, dt):
        value = self.inner.force(view, dt)
        self.log.append(value / view.mass)
        return value

    def __deepcopy__(self, memo):
        return Listener(copy.deepcopy(self.inner, memo), self.log)


@pytest.fixture(scope="session")
def planted():
    """The law at the upper end of its sizes among three drives, and a truck that can have it."""

    def plant(effect, name=None):
        truck = pool.load(name or effect.trucks[-1])
        setting = Setting(
            trucks.namespace(truck),
            3,
            60.0,
            0.1,
            5,
            np.full(3, 9000.0),
            np.array([1.0, -1.0, 1.0]),
            np.array([0, 1, 1]),
            np.linspace(25.0, 25.0 + 15.0 * 60.0, 600)[None, :].repeat(3, axis=0),
        )
        values = effect.draw(np.random.default_rng(1), scale=4.0)
        return effect.build(setting, SimpleNamespace(**values)), truck.with_grade_input()

    return plant


@pytest.fixture(scope="session")
def driven():
    """A drive with an effect, of its own family."""

    def drive(key, minutes=1.5, seed=3):
        effect = EFFECTS[key]
        slow = effect.name == "brake_fade"  # heat takes minutes
        minutes, attempt = (4.0, 2) if slow else (minutes, 0)
        return build(draw_plan("noise", seed, key, "physics", minutes, attempt, forms=effect.forms))

    return drive


@pytest.fixture(scope="session")
def along():
    """Acceleration (substeps, batch) of the hidden force along the drives, m/s2."""

    def listen(built):
        (force,) = built.oracle.forces
        log, drives = [], built.drives
        heard = built.oracle.with_forces([Listener(force, log)])
        heard.rollout(drives.u, drives.w, drives.y[:, 0], drives.y, inside=False)
        return np.array(log)

    return listen


@pytest.fixture(scope="session")
def alone():
    """The law with sizes in the middle of their ranges, started."""

    def make(key, name="trucksim", batch=2):
        effect = EFFECTS[key]
        setting = Setting(
            trucks.namespace(trucks.make(name, {})),
            batch,
            60.0,
            0.1,
            5,
            np.full(batch, 9000.0),
            np.array([1.0, -1.0][:batch]),
            np.zeros(batch, int),
            np.full((batch, 600), np.nan),
        )
        sizes = {n: 0.5 * (low + high) for n, (low, high) in effect.ranges.items()}
        (law,) = effect.build(setting, SimpleNamespace(**sizes)).forces
        law.reset(batch)
        return law

    return make


@pytest.fixture(scope="session")
def scene():
    """A view of two trucks that roll at 15 m/s, half loaded, in a middle gear."""

    def view(**given):
        base = dict.fromkeys(("acceleration", "shifting", "brake_force", "grade", "distance"), 0.0)
        base |= {"speed": 15.0, "mass": 2e4, "gear": 8.0, "ratio": 6.0, "engine_speed": 140.0}
        base |= {
            "engine_torque": 700.0,
            "traction_force": 8000.0,
            "drag_force": 700.0,
            "u0": 600.0,
            "u1": 0.0,
        }
        values = {n: np.full(2, float(v)) for n, v in {**base, **given}.items() if n != "time"}
        u = np.stack([values.pop("u0"), values.pop("u1")], axis=1)
        return SimpleNamespace(**values, u=u, time=given.get("time", 1.0))

    return view


@pytest.fixture(scope="session")
def held(scene):
    """The force of a law after `seconds` of one scene."""

    def hold(law, seconds, **given):
        for k in range(round(seconds * 100)):
            out = law.newtons(scene(**given, time=0.01 * k), 0.01)
        return out

    return hold

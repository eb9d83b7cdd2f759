"""Hidden laws along recorded moments of real drives, and alone in a made-up moment."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from deeptruck_exam.effects import EFFECTS
from deeptruck_exam.effects.law import Setting
from deeptruck_exam.worlds import WORLDS, trucks
from deeptruck_exam.worlds.drive import leader_way, simulate
from deeptruck_model.trucks import View

EVERY, MINUTES = 5, 4.0  # substeps between two moments; each of them 0.01 s
STEP_S = 0.01 * EVERY
SLOW = ("brake_fade", "torque_derate", "wheel_slip", "torque_converter_slip")  # heat and ice take minutes
STIFF = ("load_slosh", "driveline_backlash")  # which need the truck's own steps
FIELDS = [name for name in View.__annotations__ if name != "time"]


@cache
def truck_of(name):
    return trucks.make(name, {})


class Recorder:
    """A force of nothing that keeps what it sees; copies share the list."""

    def __init__(self):
        self.seen, self.calls = [], 0

    def reset(self, batch):
        pass

    def force(self, view, dt):
        if self.calls % EVERY == 0:
            values = {name: getattr(view, name).copy() for name in FIELDS}
            self.seen.append(SimpleNamespace(**values, time=view.time))
        self.calls += 1
        return np.zeros_like(view.speed)

    def __deepcopy__(self, memo):
        return self


def setting_of(truck, leader_m, batch, seconds):
    """Two roads, driven both ways."""
    return Setting(
        trucks.namespace(truck),
        batch,
        seconds,
        0.1,
        5,
        9000.0 + 40.0 * np.arange(batch),
        np.where(np.arange(batch) % 2, -1.0, 1.0),
        np.arange(batch) % 2,
        leader_m,
    )


@pytest.fixture(scope="session")
def moments():
    """(setting, views) of eight drives: each kind of drive by a person and behind a leader."""
    made = {}

    def drive(name):
        rng, world = np.random.default_rng(11), WORLDS["plain"]
        truck, recorder = truck_of(name), Recorder()
        kinds = ["highway", "suburban", "hills", "descent"] * 2
        n = round(600 * MINUTES)
        target = np.stack([world.speed_profile(rng, kind, n, 0.1) for kind in kinds])
        styles = np.array(["human"] * 4 + ["acc"] * 4)
        leader_m = leader_way(target, styles == "acc", 0.9, 0.1)
        setting = setting_of(truck, leader_m, 8, 60.0 * MINUTES)
        driver = world.driver(setting.truck, styles, target, 0.9, 0.1, rng)
        roads = world.draw_roads(rng, kinds, False)
        simulate(truck.with_forces([recorder]), roads, driver, leader_m, 0.1)
        return setting, recorder.seen

    def of(name):
        if name not in made:
            made[name] = drive(name)
        return made[name]

    return of


@pytest.fixture(scope="session")
def acted(moments):
    """Acceleration (moments, 8) of an effect's force at the upper end of its sizes, m/s2, and the moments."""
    done = {}

    def act(key):
        if key not in done:
            effect = EFFECTS[key]
            setting, seen = moments(effect.trucks[-1])
            seen = seen if effect.name in SLOW else seen[: round(90.0 / STEP_S)]
            parts = EVERY if effect.name in STIFF else 1
            sizes = effect.draw(np.random.default_rng(1), scale=4.0)
            (law,) = effect.build(setting, SimpleNamespace(**sizes)).forces
            law.reset(8)
            rows = [[law.force(view, STEP_S / parts) for _ in range(parts)][-1] / view.mass for view in seen]
            done[key] = np.array(rows), seen
        return done[key]

    return act


@pytest.fixture(scope="session")
def alone():
    """The force with sizes in the middle of their ranges, started; its setting's arrays may be changed."""

    def make(key, name="trucksim", batch=2):
        effect = EFFECTS[key]
        truck = truck_of(name if name in effect.trucks else effect.trucks[0])
        setting = setting_of(truck, np.full((batch, 600), np.nan), batch, 60.0)
        setting.start_m[:], setting.route[:] = 9000.0, 0
        sizes = {n: 0.5 * (low + high) for n, (low, high) in effect.ranges.items()}
        (law,) = effect.build(setting, SimpleNamespace(**sizes)).forces
        law.reset(batch)
        return law

    return make


@pytest.fixture(scope="session")
def between():
    """The command filter with sizes near the upper end of their ranges, started for one truck."""

    def make(key, batch=1):
        effect = EFFECTS[key]
        truck = truck_of(effect.trucks[-1])
        setting = setting_of(truck, np.full((batch, 600), np.nan), batch, 60.0)
        sizes = effect.draw(np.random.default_rng(1), scale=4.0)
        (one,) = effect.build(setting, SimpleNamespace(**sizes)).filters
        one.reset(batch)
        return one

    return make


@pytest.fixture(scope="session")
def spoilt():
    """A fault's channels after it, with the sizes given."""

    def spoil(key, channels, seed=1, **sizes):
        out = {name: values.copy() for name, values in channels.items()}
        (fault,) = EFFECTS[key].build(None, SimpleNamespace(**{"sign": 1.0, **sizes})).faults
        fault(out, 0.1, np.random.default_rng(seed))
        return out

    return spoil


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
        base |= {
            "brake_temperature": 80.0,
            "effective_mass": 2.1e4,
            "rolling_force": 1200.0,
            "grade_force": 0.0,
        }
        values = {n: np.full(2, float(v)) for n, v in {**base, **given}.items() if n != "time"}
        u = np.stack([values.pop("u0"), values.pop("u1")], axis=1)
        return SimpleNamespace(**values, u=u, time=given.get("time", 1.0))

    return view


@pytest.fixture(scope="session")
def held(scene):
    """The force of a law after `seconds` of one scene, in steps of `dt` s, longer for long ones."""

    def hold(law, seconds, dt=None, **given):
        dt = dt or (0.01 if seconds < 20.0 else 0.05)
        view = scene(**given)
        for k in range(max(1, round(seconds / dt))):
            view.time = dt * k
            out = law.force(view, dt)
        return out

    return hold

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_cacc import baseline, load_policy
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.planner import Planner
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.hard_scenes import settled
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model import simulators, trucks
from deeptruck_model.deep import Arguments, train
from deeptruck_model.trucks import driving_cycles

NAMES = ("leader_speed", "speed", "gap", "target_time_gap", "grade")


def observation(*values: object) -> dict[str, np.ndarray]:
    columns = np.broadcast_arrays(*map(np.atleast_1d, values))
    return dict(zip(NAMES, (np.asarray(x, float) for x in columns), strict=True))


def test_a_gap_that_has_opened_is_closed_without_braking_hard():
    """20 m behind its gap; a planned approach is exceeded by a fifth at most."""
    truck = simulators.load("truck:trucksim")
    scene = replace(settled(1, 250, 20.0, 2.0), gap=np.array([60.0]))
    trace = roll_out(truck, Planner(truck), scene)
    assert -1.0 < np.diff(trace["speed"][:, 0]).min() / truck.dt < -0.6
    assert trace["gap"][-1, 0] < 44.0 and trace["gap"].min() > 39.5


def test_commands_stay_within_their_reach_and_never_both(toy):
    rng, made = np.random.default_rng(0), Planner(toy)
    for _ in range(5):
        speed, leader = rng.uniform(0, 30, (2, 20))
        engine, brake = made.act(observation(leader, speed, rng.uniform(2, 150, 20), 2.0, 0.03))
        assert (engine >= made.scale.engine_low).all() and (engine <= made.scale.engine_high).all()
        assert (brake >= 0).all() and (brake <= made.scale.brake_high).all()
        assert not ((engine > made.scale.engine_low) & (brake > 0)).any()


def test_a_truck_without_a_brake_command_is_given_none(make_toy):
    class Brakeless(make_toy):
        def step(self, state, u, w):
            return super().step(state, np.column_stack([u, np.zeros(len(u))]), w)

    made = Planner(Brakeless(interface=TruckInterface("toy", brake_unit=None)))
    _, brake = made.act(observation(5.0, 20.0, 15.0, 2.0, 0.0))
    assert made._least == 0.0 and brake[0] == 0.0


def test_it_follows_more_closely_than_the_laws_over_the_pedal_map(toy):
    """On a truck 15 % heavier than the one it plans with, which it has to notice."""
    scene = scenes.moving(np.random.default_rng(0), 2, 250, toy.dt)
    pedals, truck = PedalMap.calibrate(toy), toy.with_parameters({"mass_factor": 1.15})

    def worst(driver) -> float:
        return float(np.abs(roll_out(truck, driver, scene)["time_gap_error"][100:]).max())

    assert worst(Planner(toy)) < worst(baseline("cacc", toy.interface, pedals))


def test_what_is_not_seen_gives_no_command_and_is_forgotten(toy):
    made = Planner(toy)
    made.act(observation(20.0, 20.0, [40.0, 40.0], 2.0, 0.0))
    for missing in ("gap", "speed", "leader_speed"):
        seen = observation(20.0, 20.0, [40.0, 40.0], 2.0, 0.0)
        seen[missing] = np.array([np.nan, seen[missing][1]])
        commands = np.array(made.act(seen))
        assert np.isnan(commands[:, 0]).all() and np.isfinite(commands[:, 1]).all()
    assert np.isfinite(made.act(observation(20.0, 20.0, [40.0, 40.0], 2.0, 0.0))).all()


@pytest.fixture(scope="module")
def deep_truck(tmp_path_factory):
    """The folder of a deep truck, trained for a moment."""
    out = tmp_path_factory.mktemp("planner") / "deep"
    drive = driving_cycles.drive(trucks.load("trucksim"), seconds=1200.0, seed=0, name="cycle")
    train([drive], out, Arguments(updates=240, hidden=24, decoder=16, rounds=6))
    return out


def test_over_a_deep_truck_it_is_closer_than_any_constant_command(deep_truck):
    truck = simulators.load(deep_truck)
    driver = load_policy(f"planner:{deep_truck}", truck.interface)
    scene = scenes.paper(np.random.default_rng(0), 4, 200, truck.dt)

    class Constant:
        interface, dt = truck.interface, truck.dt

        def __init__(self, engine: float) -> None:
            self.engine = engine

        def reset(self) -> None:
            pass

        def act(self, seen):
            return np.full(4, self.engine), np.zeros(4)

    def mean_error(policy) -> float:
        return float(np.abs(roll_out(truck, policy, scene)["time_gap_error"]).mean())

    held = min(mean_error(Constant(engine)) for engine in np.linspace(0.0, driver.scale.engine_high, 21))
    assert mean_error(driver) < 0.3 * held


def test_a_planner_that_is_loaded_has_run_its_simulator_and_remembers_nothing(make_toy, monkeypatch):
    """Else its first command takes as long as the simulator's step takes to compile."""
    steps = []

    class Counted(make_toy):
        def step(self, state, u, w):
            steps.append(len(u))
            return super().step(state, u, w)

    monkeypatch.setattr(simulators, "load", lambda path: Counted())
    driver, seen = load_policy("planner:toy"), observation(18.0, 15.0, 40.0, 2.0, 0.01)
    assert steps
    np.testing.assert_array_equal(driver.act(seen), Planner(make_toy()).act(seen))


def test_a_planner_of_another_trucks_simulator_is_refused(deep_truck):
    with pytest.raises(InputError, match=r"commands engine_command in N m, .*the truck takes"):
        load_policy(f"planner:{deep_truck}", TruckInterface("other", engine_unit="percent"))
    with pytest.raises(InputError, match="does not exist"):
        load_policy("planner:nowhere")

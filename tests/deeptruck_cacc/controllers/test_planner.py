from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from deeptruck_cacc import baseline, load_policy
from deeptruck_cacc.controllers import planner
from deeptruck_cacc.controllers.law import Seen
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.planner import HELD, KNOTS_S, ROWS, Planner
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


def beginning(toy, gap: float, leader_speed: float, grade: float = 0.0) -> tuple[Planner, planner._Now]:
    """A planner and what it plans from: 15 m/s, wanted time gap 2 s, no pedal."""
    made = Planner(toy)
    speed = np.array([15.0])
    past = made._start(speed)
    signals = np.array([leader_speed, 15.0, gap, 30.0, 0.0, 0.0, 0.0])[:, None]
    return made, planner._Now(Seen(*signals), np.array([grade]), past.state, past.lack, past.plan[:, 0])


@pytest.mark.parametrize(
    ("gap", "leader_speed"),
    [(30.0, 15.3), (30.6, 15.0), (60.0, 22.0), (26.0, 9.0)],  # the last two: full engine and full brake
)
def test_the_plan_is_the_best_that_a_general_optimiser_finds(toy, gap, leader_speed):
    made, now = beginning(toy, gap, leader_speed)

    def cost(plan: np.ndarray) -> float:
        rows = np.tile(plan, (1, ROWS, 1))
        return float(np.square(made.residuals(rows, now)[0, 0]).sum())

    plan = np.zeros((1, len(KNOTS_S)))
    for _ in range(30):
        plan = made._improved(plan, now)
    limits = [(-1.0, 1.0)] * len(KNOTS_S)
    best = min(
        (minimize(cost, np.full(len(KNOTS_S), x), bounds=limits, method="L-BFGS-B") for x in (-0.2, 0.3)),
        key=lambda found: found.fun,
    )
    assert cost(plan[0]) <= best.fun * 1.01 + 1e-6 < 0.9 * cost(np.zeros(len(KNOTS_S)))


def test_a_gap_that_has_opened_is_closed_without_braking_hard():
    """20 m behind its gap; a planned approach is exceeded by a fifth at most."""
    truck = simulators.load("truck:trucksim")
    scene = replace(settled(1, 250, 20.0, 2.0), gap=np.array([60.0]))
    trace = roll_out(truck, Planner(truck), scene)
    assert -1.0 < np.diff(trace["speed"][:, 0]).min() / truck.dt < -0.6
    assert trace["gap"][-1, 0] < 44.0 and trace["gap"].min() > 39.5


def test_one_step_is_enough_where_the_truck_is_linear(toy):
    """The toy is, as long as the engine alone drives: a further step changes nothing."""
    made, now = beginning(toy, 30.1, 15.05, grade=0.03)
    start = np.full((1, len(KNOTS_S)), 0.4)
    once = made._improved(start, now)
    assert once.min() > 0.0 and np.abs(once - start).max() > 0.1
    np.testing.assert_allclose(made._improved(once, now), once, atol=0.01)


def test_a_truck_that_feels_no_small_change_is_driven_too(make_toy):
    """Its engine knows four torques only, so that no derivative leads from one to the next."""

    class Stepped(make_toy):
        def step(self, state, u, w):
            engine = np.floor(u[:, :1] / 600.0) * 600.0  # N m; full engine is 2400
            return super().step(state, np.hstack([engine, u[:, 1:]]), w)

    made, now = beginning(Stepped(), gap=60.0, leader_speed=22.0)
    plan = made._improved(np.zeros((1, len(KNOTS_S))), now)
    tried = np.zeros((1, ROWS, len(KNOTS_S)))
    tried[:, 0], tried[:, 1 : len(HELD) + 1] = plan, HELD[:, None]
    cost = np.square(made.residuals(tried, now)[0]).sum(axis=1)
    assert cost[0] <= cost[1:].min() and plan.min() > 0.25


def test_a_step_within_bounds_is_that_of_bounded_least_squares():
    rng = np.random.default_rng(0)
    jacobian, residuals = rng.normal(size=(5, 12, 4)), rng.normal(size=(5, 12))
    low, high = -rng.uniform(0.0, 0.1, (5, 4)), rng.uniform(0.0, 0.1, (5, 4))
    step = planner._bounded_step(jacobian, residuals, low, high)
    for k in range(5):

        def cost(x: np.ndarray, k: int = k) -> float:
            return float(np.square(jacobian[k] @ x + residuals[k]).sum() + planner.DAMPING * x @ x)

        found = minimize(cost, np.zeros(4), bounds=list(zip(low[k], high[k], strict=True)), tol=1e-12)
        np.testing.assert_allclose(step[k], found.x, atol=1e-4)


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


def test_the_same_twice_and_rows_do_not_know_each_other(toy):
    scene = scenes.moving(np.random.default_rng(1), 3, 60, toy.dt)
    driver = Planner(toy)
    once = roll_out(toy, driver, scene)["engine_command"]
    np.testing.assert_array_equal(roll_out(toy, driver, scene)["engine_command"], once)
    alone = replace(
        scene, **{n: getattr(scene, n)[:1] for n in ("leader_speed", "speed", "gap", "time_gap",
                                                     "leader_acceleration", "grade")}
    )  # fmt: skip
    np.testing.assert_allclose(roll_out(toy, driver, alone)["engine_command"][:, 0], once[:, 0], atol=1e-6)


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

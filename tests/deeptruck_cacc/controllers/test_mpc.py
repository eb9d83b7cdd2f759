from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from deeptruck_cacc import baseline
from deeptruck_cacc.controllers import mpc
from deeptruck_cacc.controllers.law import Seen
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.environments import hard_scenes
from deeptruck_cacc.environments.rollouts import roll_out


def seen(**changes: float | list[float]) -> Seen:
    values = {
        "leader_speed": 15.0,
        "speed": 15.0,
        "gap": 30.0,
        "target_gap": 30.0,
        "leader_acceleration": 0.0,
        "acceleration": 0.0,
        "integral": 0.0,
    } | changes
    return Seen(**dict(zip(values, np.broadcast_arrays(*map(np.atleast_1d, values.values())), strict=True)))


def reference(s: Seen, low: float = -3.5, high: float = 1.5) -> float:
    """The same plan step by step, as bounded least squares, where no gap is short."""
    time_gap, steps, h = s.target_gap[0] / s.speed[0], 10, 0.5

    def plan(a: np.ndarray) -> np.ndarray:
        v, gap, leader, pull = s.speed[0], s.gap[0], s.leader_speed[0], s.leader_acceleration[0]
        out, before = [], s.acceleration[0]
        for k in range(steps):
            gap -= h * v + h * h / 2 * a[k]
            v += h * a[k]
            t = h * (k + 1)
            gone = 2.0 * (1 - np.exp(-t / 2.0))
            way = leader * t + pull * 2.0 * (t - gone)
            out += [np.sqrt(mpc.GAP) * (gap + way - time_gap * v)]
            out += [np.sqrt(mpc.SPEED) * (leader + pull * gone - v), np.sqrt(mpc.PULL) * a[k]]
            out += [np.sqrt(mpc.CHANGE) * (a[k] - before)]
            before = a[k]
        return np.array(out)

    still = plan(np.zeros(steps))
    columns = np.stack([plan(e) - still for e in np.eye(steps)], axis=1)
    return float(lsq_linear(columns, -still, (low, high), tol=1e-12).x[0])


@pytest.mark.parametrize(
    "case",
    [
        {},
        {"gap": 36.0, "acceleration": 0.4},
        {"leader_acceleration": -1.0},
        {"gap": 60.0, "leader_speed": 22.0},  # full acceleration allowed
        {"gap": 26.0, "leader_speed": 9.0},  # hardest braking allowed
    ],
)
def test_the_plan_is_the_best_one(case):
    s = seen(**case)
    assert mpc.mpc(s)[0] == pytest.approx(reference(s), abs=5e-3)


def test_rows_do_not_know_each_other():
    rows = {"gap": [20.0, 30.0, 45.0], "leader_speed": [12.0, 15.0, 17.0]}
    together = mpc.mpc(seen(**rows))
    alone = [mpc.mpc(seen(gap=g, leader_speed=v))[0] for g, v in zip(*rows.values(), strict=True)]
    np.testing.assert_allclose(together, alone, atol=1e-9)
    assert together[0] < together[1] < together[2]


def test_what_is_not_seen_is_not_guessed():
    out = mpc.mpc(seen(gap=[np.nan, 30.0]))
    assert np.isnan(out[0]) and np.isfinite(out[1])


def test_it_stops_short_of_a_leader_that_stops_hard(toy):
    """CACC of the same table runs into it: the least gap is a constraint of the plan, not an error in it."""
    scene = hard_scenes.stop(np.random.default_rng(0), 4, 400, toy.dt)
    pedals = PedalMap.calibrate(toy)
    least = {
        law: roll_out(toy, baseline(law, toy.interface, pedals, toy.dt), scene)["gap"].min()
        for law in ("mpc", "cacc")
    }
    assert least["mpc"] > 3.0 > 2.0 > least["cacc"]

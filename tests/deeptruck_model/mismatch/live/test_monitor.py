"""The monitor while driving: silent on the truck it knows, exact on one it does not, not fooled by holes."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_model import trucks
from deeptruck_model.mismatch.live.monitor import Monitor, Sample
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import driving_cycles

TRUCK = trucks.load("trucksim")
MASS = TRUCK.parameters()["mass"]


class Dragging:
    """2 kN against motion from the second minute to the third."""

    def reset(self, batch: int) -> None: ...

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        on = 60.0 < view.time < 120.0
        return np.where(view.speed > 0.1, -2000.0 * on, 0.0)


def listen(monitor: Monitor, r: Recording, *, late_commands: int = 0) -> tuple[list[Sample], list[float]]:
    """Play a recording to a monitor as a run would; returns its samples and the times of alarm."""
    samples, alarms = [], []
    for k in range(len(r)):
        t = float(r.time[k])
        heard = monitor.hear_speed(t, float(r.channels["speed"][k]))
        monitor.hear_road(t, {"grade": float(r.channels["grade"][k])})
        j = k - late_commands
        if j >= 0:
            u = {name: float(r.channels[name][j]) for name in ("engine_command", "brake_command")}
            heard += monitor.hear_command(float(r.time[j]), u)
        samples += heard
        if monitor.alarm is not None:
            alarms.append(t)
    return samples, alarms


@pytest.fixture(scope="module")
def honest() -> Recording:
    return driving_cycles.drive(TRUCK, seconds=180.0, seed=3)


@pytest.fixture(scope="module")
def dragged() -> Recording:
    settings = driving_cycles.FREEWAY
    return driving_cycles.drive(TRUCK.with_forces([Dragging()]), seconds=180.0, seed=4, settings=settings)


def test_on_the_truck_it_knows_the_residual_is_nothing(honest: Recording) -> None:
    monitor = Monitor(TRUCK)
    samples, alarms = listen(monitor, honest)
    assert alarms == [] and monitor.located == []
    residual = np.array([s.residual for s in samples])
    assert len(samples) == len(honest) - 1
    assert np.isfinite(residual).mean() > 0.5 and np.nanmedian(np.abs(residual)) < 1e-3
    assert [s.time for s in samples] == pytest.approx(honest.time[1:])


def test_a_missing_force_is_located_with_its_size(dragged: Recording) -> None:
    monitor = Monitor(TRUCK)
    samples, alarms = listen(monitor, dragged)
    assert 64.0 < alarms[0] < 75.0 and alarms[-1] < 127.0
    (segment,) = [s for s in monitor.located if s.end - s.start > 20.0]
    assert segment.start == pytest.approx(62.0, abs=4.0) and segment.end == pytest.approx(122.0, abs=4.0)
    assert segment.mean_m_s2 * MASS == pytest.approx(-2000.0, rel=0.15)
    during = [s.smoothed for s in samples if 70.0 < s.time < 115.0]
    assert np.nanmedian(during) == pytest.approx(-2000.0 / MASS, rel=0.15)


def test_what_was_located_is_forgotten_after_the_window(dragged: Recording) -> None:
    monitor = Monitor(TRUCK, window_s=30.0)
    listen(monitor, dragged)
    assert monitor.located == []


def test_commands_that_arrive_late_are_waited_for(honest: Recording) -> None:
    at_once, _ = listen(Monitor(TRUCK), honest)
    later, alarms = listen(Monitor(TRUCK), honest, late_commands=3)
    assert alarms == []
    both = zip(at_once[: len(later)], later, strict=True)
    assert all(a == b or np.isnan([a.residual, b.residual]).all() for a, b in both)


@pytest.mark.parametrize("channel", ["speed", "engine_command", "grade"])
def test_after_a_hole_nothing_is_judged_until_the_state_is_known_again(
    honest: Recording, channel: str
) -> None:
    holes = honest.piece(0, len(honest))
    holes.channels[channel] = holes.channels[channel].copy()
    holes.channels[channel][900:905] = np.nan
    samples, alarms = listen(Monitor(TRUCK), holes)
    assert alarms == []
    judged = np.array([s.time for s in samples if np.isfinite(s.residual)])
    assert not ((judged > 90.6) & (judged < 96.0)).any() and (judged > 97.0).any()


def test_a_faster_clock_is_laid_on_the_simulators(honest: Recording) -> None:
    monitor, times = Monitor(TRUCK), []
    fine = np.arange(0.0, 60.0, 0.02)
    speed = np.interp(fine, honest.time, honest.channels["speed"])
    for t, v in zip(fine, speed, strict=True):
        k = int(t / 0.1 + 1e-6)
        monitor.hear_road(0.1 * k, {"grade": float(honest.channels["grade"][k])})
        u = {name: float(honest.channels[name][k]) for name in ("engine_command", "brake_command")}
        times += [s.time for s in monitor.hear_command(0.1 * k, u)]
        times += [s.time for s in monitor.hear_speed(float(t), float(v))]
    assert np.diff(times) == pytest.approx(0.1)


def test_without_commands_nothing_is_said(honest: Recording) -> None:
    monitor = Monitor(TRUCK)
    samples = [s for k in range(300) for s in monitor.hear_speed(0.1 * k, float(honest.channels["speed"][k]))]
    assert samples and all(np.isnan(s.residual) for s in samples)

"""Trucks, roads, speeds, drivers and sensors within reason."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_exam import worlds
from deeptruck_exam.cases.build import Built, build
from deeptruck_exam.cases.case import measure
from deeptruck_exam.cases.plan import draw_plan
from deeptruck_exam.worlds import roads, speeds, trucks

SPEED_STEP = 1.0 / 3.6 / 256.0


@pytest.fixture(scope="module")
def drives() -> Built:
    return build(draw_plan("nothing_missing", 8, None, "physics", 1.0))


@pytest.mark.parametrize(
    ("kind", "low", "high"),
    [("highway", 14.0, 28.0), ("suburban", 0.0, 18.0), ("hills", 0.0, 24.0), ("descent", 0.0, 20.0)],
)
def test_speeds_are_those_of_the_kind_of_drive(kind: str, low: float, high: float) -> None:
    speed = speeds.profile(np.random.default_rng(4), kind, worlds.values()["speeds"], 3000, 0.1)
    assert speed.shape == (3000,) and low <= speed.min() and speed.max() <= high
    assert np.abs(np.diff(speed)).max() < 0.3
    assert kind != "suburban" or speed.min() < 0.5


def test_roads_climb_and_fall_and_a_way_down_goes_down() -> None:
    rng, values = np.random.default_rng(4), worlds.values()["roads"]
    drawn = roads.draw(rng, ["hills"] * 4 + ["descent"] * 4, values, False)
    grade = np.array([drawn.grade_at(np.full(8, m)) for m in np.arange(0.0, 40000.0, 50.0)])
    assert np.abs(grade).max() <= 0.075
    assert 0.015 < grade[:, :4].std() < 0.045 and np.all(grade[:, 4:].mean(axis=0) < -0.03)
    assert not roads.draw(rng, ["hills", "descent"], values, True).grade.any()


def test_heights_have_the_spectrum_that_is_asked_for() -> None:
    values = {**worlds.values()["roads"], "exponent": [2.4, 2.4], "smoothed_m": [120.0, 120.0]}
    slopes = [roads.slopes(np.random.default_rng(k), "highway", values) for k in range(40)]
    wave = np.fft.rfftfreq(roads.CELLS, roads.STEP_M)
    power = np.mean([np.abs(np.fft.rfft(s)) ** 2 for s in slopes], axis=0)
    band = (wave > 1 / 3000.0) & (wave < 1 / 600.0)
    exponent = -np.polyfit(np.log(wave[band]), np.log(power[band]), 1)[0] + 2.0  # of heights, from slopes
    assert exponent == pytest.approx(2.4, abs=0.4)


def test_every_parameter_of_the_yaml_is_one_of_the_trucks() -> None:
    for name in worlds.values()["trucks"]["mass"]:
        assert set(worlds.values()["trucks"]["factors"]) <= set(trucks.reference(name))


def test_people_and_controllers_follow_the_wished_speed() -> None:
    for seed, level in ((5, "nothing_missing"), (6, "closed_loop")):
        drives = build(draw_plan(level, seed, None, "physics", 1.5)).drives
        speed = drives.channels["speed"]
        assert speed.min() >= 0.0 and speed.max() < 32.0
        pedals = drives.u
        assert pedals.min() >= 0.0 and not np.any((pedals[:, :, 0] > 1.0) & (pedals[:, :, 1] > 1.0))


def test_sensors_have_their_resolution_and_little_error(drives: Built) -> None:
    true = drives.drives.channels
    for row, channels in enumerate(measure(drives)):
        counts = channels["speed"] / SPEED_STEP
        assert np.allclose(counts, np.rint(counts), atol=1e-3) or np.allclose(
            channels["speed"] % 0.05, 0, atol=0.05
        )
        assert np.std(channels["speed"] - true["speed"][row]) < 0.3
        assert abs(np.mean(channels["acceleration"] - true["acceleration"][row])) < 0.04

"""Comparing a recovered profile with the withheld one, on a made-up road."""

import numpy as np
import pytest

from deeptruck_core.signals import TruckInterface
from deeptruck_exam.real import withheld
from deeptruck_exam.real.withheld import (
    compare_profile,
    examine_withheld,
    read_profiles,
    withhold,
)
from deeptruck_model.recordings import Recording

GRAVITY = 9.81


@pytest.fixture
def drive():
    n = 1200
    grade = 0.03 * np.sin(np.arange(n) / 90.0)
    channels = {
        "speed": np.full(n, 20.0),
        "acceleration": -GRAVITY * grade,
        "engine_command": np.zeros(n),
        "grade": grade,
        "elevation": np.cumsum(grade) * 20.0,
    }
    return Recording("fit#1", 1.0, channels, TruckInterface("x", brake_unit=None, fuel=False), start_s=500.0)


def profile(tmp_path, drive, gain, since_bag):
    lines = ["recording,time_s,distance_m,name,value"]
    for k in range(0, len(drive), 5):
        time = k + (drive.start_s if since_bag else 0.0)
        value = gain * drive.channels["grade"][k] + 0.01
        lines.append(f"fit#1,{time},{20.0 * k},road_grade,{value}")
        lines.append(f"fit#1,{time},{20.0 * k},wind,99.0")
    (tmp_path / "profiles.csv").write_text("\n".join(lines) + "\n")
    return read_profiles(tmp_path / "profiles.csv")


@pytest.mark.parametrize("since_bag", [True, False])
def test_a_scaled_copy_correlates_fully_and_shows_its_slope(tmp_path, drive, since_bag):
    found = compare_profile(profile(tmp_path, drive, 0.7, since_bag), [drive])
    assert found.windows == len(drive) // 21
    assert found.correlation == pytest.approx(1.0, abs=0.01)
    assert found.slope == pytest.approx(0.7, abs=0.02)


def test_noise_does_not_correlate(tmp_path, drive):
    noise = np.random.default_rng(0).standard_normal(len(drive))
    profiles = {"fit#1": (np.arange(len(drive), dtype=float), noise)}
    found = compare_profile(profiles, [drive])
    assert abs(found.correlation) < 0.4


def test_nothing_to_compare_is_none(drive):
    assert compare_profile({}, [drive]) is None


def test_what_is_withheld_is_gone(drive):
    blind = withhold(drive)
    assert set(blind.channels) == {"speed", "acceleration", "engine_command"}
    assert not blind.interface.grade and blind.w.shape == (len(drive), 0)


def test_absent_logs_are_skipped(tmp_path):
    assert examine_withheld(tmp_path / "new", tmp_path) == []


def test_a_blind_bag_reads_back_piece_by_piece(tmp_path, drive):
    pieces = [drive.piece(0, 400), drive.piece(450, 1200)]
    opened = withheld._written_blind(pieces, tmp_path / "bag")
    assert [len(r) for r in opened] == [400, 750]
    assert len({r.name for r in opened}) == 2 and all("grade" in r.channels for r in opened)

"""The road of one vehicle used for another: where both drove, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_model import trucks
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.roads.recovered_road import RecoveredSlope, Roads
from deeptruck_model.mismatch.roads.road_of_another import with_road_of_another
from deeptruck_model.recordings import Recording

TRUCK = trucks.load("freightliner")
DT = 1.0


def hills(seed: int) -> np.ndarray:
    """The slope every metre of 40 km, of hills of half a kilometre and longer."""
    rng = np.random.default_rng(seed)
    rough = rng.standard_normal(400)
    smooth = np.convolve(rough, np.hanning(9), mode="same")
    slope: np.ndarray = np.interp(np.arange(40_000.0), 100.0 * np.arange(400), 0.02 * smooth / smooth.std())
    return slope


def driven(name: str, slope: np.ndarray, speed: float, seed: int) -> tuple[Recording, RecoveredSlope]:
    """A drive over a profile, and its recovered slope: with noise, and with another zero."""
    n = int(len(slope) / speed / DT) - 1
    channels = {"speed": np.full(n, speed), "acceleration": np.zeros(n)}
    recording = Recording(name, DT, channels, TRUCK.interface)
    distance = speed * DT * np.arange(1, n + 1)
    rng = np.random.default_rng(seed)
    recovered = (
        np.interp(distance, np.arange(len(slope)), slope) + 0.003 * rng.standard_normal(n) + 0.002 * seed
    )
    return recording, RecoveredSlope(DT * np.arange(n), distance, recovered)


def roads(*drives: tuple[Recording, RecoveredSlope]) -> Roads:
    return Roads({recording.name: recovered for recording, recovered in drives})


def test_the_slope_of_the_other_is_the_grade_on_what_both_drove() -> None:
    a, b, elsewhere = hills(1), hills(2), hills(3)
    own = driven("own", np.concatenate([a[:15_000], b[:15_000]]), 20.0, 0)
    other = driven("other", np.concatenate([elsewhere[:20_000], a[:15_000]]), 15.0, 1)
    pieces, (covered,) = with_road_of_another(roads(own), roads(other), [own[0]])
    assert covered.km == pytest.approx(30.0, abs=0.1) and covered.turned_km < 0.3
    assert covered.same_way_km == pytest.approx(15.0, abs=1.0)
    assert str(covered).startswith(f"own: {covered.same_way_km:.1f} of 30.0 km")
    (piece,) = pieces
    along = 20.0 * (piece.start_s + DT * np.arange(1, len(piece) + 1))
    right = np.interp(along, np.arange(len(a)), a)
    shared = along < 15_000.0
    assert np.corrcoef(piece.channels["grade"][shared], right[shared])[0, 1] > 0.95
    assert np.mean(piece.channels["grade"][shared] - right[shared]) == pytest.approx(0.002, abs=5e-4)
    assert piece.interface.grade and "grade" not in own[0].channels


def test_a_road_that_was_driven_the_other_way_turns_its_sign() -> None:
    a = hills(4)[:20_000]
    own, other = driven("own", a, 20.0, 0), driven("other", -a[::-1], 25.0, 0)
    (piece,), (covered,) = with_road_of_another(roads(own), roads(other), [own[0]])
    assert covered.turned_km > 18.0 and covered.same_way_km < 0.5
    along = 20.0 * (piece.start_s + DT * np.arange(1, len(piece) + 1))
    right = np.interp(along, np.arange(len(a)), a)
    assert np.corrcoef(piece.channels["grade"], right)[0, 1] > 0.95


def test_what_shares_no_road_is_refused_and_what_is_not_shared_is_said() -> None:
    own, third = driven("own", hills(10), 20.0, 0), driven("third", hills(11), 20.0, 0)
    other = driven("other", hills(10)[5000:17_000], 20.0, 1)
    with pytest.raises(InputError, match="no 6 km of these recordings agree"):
        with_road_of_another(roads(third), roads(driven("short", hills(7)[:3000], 20.0, 0)), [third[0]])
    pieces, covered = with_road_of_another(roads(own, third), roads(other), [own[0], third[0]])
    assert {piece.name for piece in pieces} == {"own"}
    assert str(covered[1]) == f"third: none of its {covered[1].km:.1f} km is on a road of the other"


def test_unrelated_hills_are_seldom_alike() -> None:
    """Of 200 such pairs 13 had 8 to 11 km in common by chance."""
    by_chance = 0
    for k in range(20):
        own = driven("own", hills(1000 + 2 * k), 20.0, 0)
        other = driven("other", hills(1001 + 2 * k)[:20_000], 20.0, 1)
        try:
            with_road_of_another(roads(own), roads(other), [own[0]])
        except InputError:
            continue
        by_chance += 1
    assert by_chance <= 4


def test_a_recording_with_a_grade_or_without_a_recovered_slope_is_refused() -> None:
    recording, recovered = driven("own", hills(8), 20.0, 0)
    graded = Recording(
        "own", DT, recording.channels | {"grade": recording.channels["speed"]}, TRUCK.interface
    )
    with pytest.raises(InputError, match="grade of its own"):
        with_road_of_another(Roads({"own": recovered}), Roads({"own": recovered}), [graded])
    with pytest.raises(InputError, match="no slope was found for these recordings"):
        with_road_of_another(Roads({}), Roads({"own": recovered}), [recording])

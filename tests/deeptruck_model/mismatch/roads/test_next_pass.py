"""One pass over a road predicts another beyond the segment by which it was found, or shows nothing."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from deeptruck_model._io.json_data import from_json, to_json
from deeptruck_model.mismatch.roads.next_pass import NextPass, next_pass
from deeptruck_model.mismatch.roads.windows import STEP_M, Windows

STEPS = 400  # of 100 m


def road(seed: int) -> NDArray[np.float64]:
    out: NDArray[np.float64] = 0.3 * gaussian_filter1d(np.random.default_rng(seed).normal(size=STEPS), 4.0)
    return out


def windows(*profiles: NDArray[np.float64]) -> Windows:
    along = STEP_M * np.arange(STEPS + 1).astype(np.float64)
    return Windows.of([(along, np.append(p, p[-1]).astype(np.float64)) for p in profiles])


def places(w: Windows, way: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every window of the first profile, the place on the second where it was found again, and whether the
    other way."""
    count = int((w.profile == 0).sum())
    here = np.arange(0, count, 8)
    there = count + (here if way > 0 else count - 1 - here)
    return here, there, np.full(len(here), way < 0)


@pytest.mark.parametrize("way", [1, -1])
def test_a_road_that_goes_on_is_shown(way: int) -> None:
    there = road(0)
    noisy = (there if way > 0 else -there[::-1]) + 0.2 * road(1) + 0.05
    found = next_pass(windows(there, noisy), *places(windows(there, noisy), way))
    assert found is not None and found.shown
    assert 10.0 < found.km < 34.0 and found.left < 0.4 * found.rms
    read = from_json(NextPass, to_json(found))
    assert read is not None and read.shown and read.left == pytest.approx(found.left, abs=1e-4)


def test_another_road_beyond_shows_nothing() -> None:
    w = windows(road(0), road(1))
    found = next_pass(w, *places(w, 1))
    assert found is not None and not found.shown
    assert found.left > found.rms


def test_a_road_that_ends_predicts_nothing() -> None:
    w = windows(road(0), road(0))
    here, there, reverse = places(w, 1)
    assert next_pass(w, here[-1:], there[-1:], reverse[-1:]) is None

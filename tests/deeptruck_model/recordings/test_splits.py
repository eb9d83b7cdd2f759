from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording, data_hash, split
from deeptruck_model.recordings.splits import refuse_shared


def counting(count: int, start: int = 0) -> Recording:
    """A recording whose speed counts its samples, so that order and completeness can be seen."""
    values = np.arange(start, start + count, dtype=float)
    return Recording(f"r{start}", 0.1, {"speed": values, "acceleration": values}, TruckInterface("t"))


def speeds(part: list[Recording]) -> list[float]:
    return [v for recording in part for v in recording.channels["speed"]]


def test_parts_follow_each_other_in_time() -> None:
    recordings = [counting(300), counting(50, 300), counting(650, 350)]
    train, validation, test = split(recordings)
    assert speeds(train) + speeds(validation) + speeds(test) == list(range(1000))
    assert [len(speeds(part)) for part in (train, validation, test)] == [700, 150, 150]
    assert validation[0].start_s == pytest.approx((700 - 350) * 0.1)


def test_a_share_of_nothing_is_empty() -> None:
    train, validation, test = split([counting(100)], (1.0, 0.0, 0.0))
    assert len(speeds(train)) == 100 and not validation and not test


@pytest.mark.parametrize("fractions", [(0.7, 0.2, 0.2), (1.2, -0.1, -0.1), (0.5, 0.5)])
def test_shares_must_add_up(fractions: tuple[float, float, float]) -> None:
    with pytest.raises(InputError, match="add up to 1"):
        split([counting(100)], fractions)


def test_the_hash_names_the_data() -> None:
    one = counting(100)
    assert data_hash([one]) == data_hash([counting(100)])
    changed = {**one.channels, "speed": one.channels["speed"] + np.where(np.arange(100) == 50, 1e-12, 0.0)}
    assert data_hash([replace(one, channels=changed)]) != data_hash([one])
    assert data_hash([replace(one, interface=TruckInterface("other"))]) != data_hash([one])
    assert data_hash([one, counting(5)]) != data_hash([one])


def test_driving_that_two_recordings_share_is_refused() -> None:
    """Whole copies under any name, parts, and uploads that overlap; not what is alike for a moment."""
    monday = replace(counting(1200), name="monday")
    copy, part = replace(monday, name="copy"), monday.piece(500, 900)
    late = replace(counting(1000, 800), name="late")
    refuse_shared([monday, counting(1000, 1200)])
    refuse_shared([monday, counting(60)])
    refuse_shared([replace(counting(1), channels={"speed": np.full(600, 20.0)})] * 2)  # alike by chance
    for pair, says in (
        ([monday, copy], "'copy' is in 'monday' too"),
        ([monday, monday], "'monday' is given twice"),
        ([monday, part], "'monday' is given twice"),
        ([monday, late], "40 s of 'late' is in 'monday' too"),
    ):
        with pytest.raises(InputError, match=says):
            refuse_shared(pair)
    with pytest.raises(InputError, match="'copy' is the drive 'monday', which is to be fitted and held out"):
        refuse_shared([monday], [copy])
    refuse_shared([monday, copy], [counting(1000, 1200)])

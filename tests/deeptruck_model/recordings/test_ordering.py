"""A queue gives what is stamped before a moment, sorted, and holds back the rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from deeptruck_model.recordings.ordering import Queue


def test_what_is_stamped_from_the_moment_on_waits() -> None:
    queue = Queue("/t", Path("bag"))
    queue.put(np.array([1, 3, 2, 5]), [np.array([10.0, 30.0, 20.0, 50.0])])
    first, rest = queue.take(3), queue.take(None)
    assert (first.stamps.tolist(), first.columns[0].tolist()) == ([1, 2], [10.0, 20.0])
    assert (rest.stamps.tolist(), rest.columns[0].tolist()) == ([3, 5], [30.0, 50.0])

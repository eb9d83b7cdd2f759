"""What a finding tells of its sizes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from deeptruck_model.mismatch.report import findings
from deeptruck_model.mismatch.result import Size


def test_times_of_every_part_of_a_shape_are_told() -> None:
    """A brake that rubs for 30 s after its release was told without them, as another part stood beside."""
    parts = [{"keeps_s": 30.0}, {"frees_m": 200.0, "keeps_s": 3.0}, {"gate": ("speed", "above", 7.0)}]
    shape: Any = SimpleNamespace(settings={"parts": parts})
    told = {name: size.value for name, size in findings.picked(shape).items()}
    assert told == {"keeps_s": 30.0, "frees_m": 200.0}


def test_a_shape_of_one_part_tells_its_own() -> None:
    shape: Any = SimpleNamespace(settings={"tau_s": 0.6, "trials": 3.0})
    assert findings.picked(shape) == {"tau_s": Size(0.6, "s", picked=True)}

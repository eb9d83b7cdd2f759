"""What a finding tells of its sizes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from deeptruck_model.mismatch.mechanisms.air_and_tyres import WarmsInTime
from deeptruck_model.mismatch.mechanisms.brakes import Keeps, RubsFree
from deeptruck_model.mismatch.mechanisms.variants import Gate, Gated, Static, Sum
from deeptruck_model.mismatch.report import findings
from deeptruck_model.mismatch.result import Size


def test_times_of_every_part_of_a_shape_are_told() -> None:
    """A brake that rubs for 30 s after its release was told without them, as another part stood beside."""
    gated = Gated(Static(Keeps(3.0)), Gate("speed", "above", 7.0))
    term: Any = SimpleNamespace(variant=Sum((Static(Keeps(30.0)), Static(RubsFree(200.0)), gated)))
    told = {name: size.value for name, size in findings.picked(term).items()}
    assert told == {"keeps_s": 30.0, "frees_m": 200.0}


def test_a_shape_of_one_part_tells_its_own() -> None:
    term: Any = SimpleNamespace(variant=Static(WarmsInTime(0.6)))
    assert findings.picked(term) == {"tau_s": Size(0.6, "s", picked=True)}

"""The oracle knows the law that acts, and finds what it costs not to."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from deeptruck_exam.cases.build import build_case
from deeptruck_exam.cases.trace import Trace, setting_of
from deeptruck_exam.oracle import limit
from deeptruck_exam.oracle.limit import Limited
from deeptruck_exam.oracle.oracle import Evidence, Oracle
from deeptruck_exam.worlds import trucks
from deeptruck_model.errors import InputError

SOME = (
    "soft_torque_limit",
    "road_speed_limiter",
    "steady_wind",
    "wrong_mass",
    "network_delay",
    "exhaust_flap",
)


@pytest.fixture(scope="module")
def oracle() -> Oracle:
    return Oracle(build_case("noise", 11, "soft_torque_limit", minutes=1.0))


def test_a_law_asked_along_the_drives_says_what_it_did(oracle: Oracle) -> None:
    built = oracle.built
    trace = Trace.of(trucks.make(built.plan.truck, built.plan.values), built.drives, setting_of(built))
    (effect,), (sizes,) = built.plan.effects, built.sizes
    planted = effect.build(trace.setting, SimpleNamespace(**sizes))
    asked = trace.acceleration(planted.forces)[0]
    true = built.extra[:, 1 : asked.shape[1] + 1]
    assert np.abs(true).max() > 0.05
    assert np.corrcoef(asked.ravel(), true[:, : asked.shape[1]].ravel())[0, 1] > 0.97


def test_the_law_that_acts_is_first_and_others_need_not_be(oracle: Oracle) -> None:
    laws = oracle.evidence(SOME).laws
    assert set(laws) <= set(SOME) and {"soft_torque_limit", "steady_wind", "wrong_mass"} <= set(laws)
    assert max(laws, key=lambda key: laws[key]) == "soft_torque_limit"
    assert laws["soft_torque_limit"] > 5.0 + max(laws["steady_wind"], laws["wrong_mass"])


def test_a_name_has_the_mean_of_its_laws_and_nothing_is_one_of_them() -> None:
    found = Evidence({"a": 10.0, "b": 0.0, "c": 4.0}, {"a": "x", "b": "x", "c": "y"})
    assert found.of_names() == pytest.approx({"nothing": 0.0, "x": 10.0 - np.log(2.0), "y": 4.0}, abs=1e-3)
    assert found.of_names(("a",))["x"] == 0.0


def test_without_the_hidden_law_its_name_is_missed() -> None:
    key = "soft_torque_limit"
    case = Limited("noise", 1, key, "torque_limit", 300.0, {key: 300.0, "steady_wind": -2.0})
    known, unknown = (limit.scored([case], law_known=known) for known in (True, False))
    assert (known.first, known.in_set, known.size) == (1.0, 1.0, 1.0) and known.log_score > -0.1
    assert (unknown.first, unknown.in_set) == (0.0, 0.0) and unknown.log_score < -4.0


def test_another_folder_is_refused_and_stays(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match=r"mine\.txt"):
        limit.run(tmp_path, 1, 0, 1)
    assert (tmp_path / "mine.txt").read_text() == "mine"

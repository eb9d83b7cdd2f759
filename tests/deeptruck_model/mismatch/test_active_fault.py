"""A fault of the truck's own that was active while a force acts is told beside it, and only then."""

from __future__ import annotations

import importlib.resources
import json
from collections.abc import Mapping
from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from numpy.typing import NDArray

from deeptruck_model import driving_cycles, mismatch, trucks
from deeptruck_model.mismatch.active_fault import ActiveFault, active_fault
from deeptruck_model.mismatch.data.prepared import Prepared, prepare
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.result import Verdict
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import TruckInterface

Array = NDArray[np.float64]
SCHEMA = json.loads(importlib.resources.files(mismatch).joinpath("verdict.schema.json").read_text())
N, HALF = 6000, 3000  # rows of the evidence, and of each of its recordings
AT = np.arange(N)
HOT = {"fault_spn": 110.0, "fault_fmi": 16.0}


def recorded(channels: Mapping[str, Array], e: Evidence) -> list[Prepared]:
    """Two recordings at twice the rate of the evidence, with channels given at its rows."""
    interface = TruckInterface("test", "N m", "percent", grade=False, fuel=False)
    out = []
    for k, s in enumerate(e.stretches):
        rows = {name: np.repeat(values[s.rows], 2) for name, values in channels.items()}
        driven = {
            "speed": np.repeat(e["speed"][s.rows], 2),
            "acceleration": np.zeros(2 * HALF),
            "engine_command": np.zeros(2 * HALF),
            "brake_command": np.zeros(2 * HALF),
        }
        out.append(prepare(Recording(f"{k}", e.dt / 2, driven | rows, interface), False))
    return out


def told(
    e: Evidence, force: Array, on: NDArray[np.bool_], code: Mapping[str, float] = HOT
) -> ActiveFault | None:
    channels = {name: np.where(on, value, 0.0) for name, value in code.items()}
    return active_fault(force, e, recorded(channels, e))


def test_a_fault_that_is_active_where_a_force_acts_is_told(nothing_missing: Evidence) -> None:
    acting = (AT > 1000) & (AT < 2000) | (AT > 4000) & (AT < 4500)
    on = np.roll(acting, 100) | (AT > 5500)
    fault = told(nothing_missing, np.where(acting, -0.3, 0.0), on)
    assert fault is not None and (fault.spn, fault.fmi) == (110, 16)
    assert fault.while_acting == pytest.approx(1299 / 1498, abs=0.01)
    assert fault.otherwise == pytest.approx((200 + 499) / 4502, abs=0.01)
    assert str(fault) == (
        "a fault (SPN 110 FMI 16) was active in 87 % of the time in which it acts, "
        "and in 16 % of the other time"
    )


def test_a_derate_is_told_before_the_code_that_comes_with_it(nothing_missing: Evidence) -> None:
    on = AT > 3500
    fault = told(nothing_missing, np.where(on, -0.3, 0.0), on, {"derate_active": 1.0, **HOT})
    assert fault is not None and (fault.spn, fault.fmi, fault.otherwise) == (1569, None, 0.0)
    assert str(fault).startswith("the engine's derate (SPN 1569) was active in 100 %")


LATE = AT > 3000


@pytest.mark.parametrize(
    ("acting", "on"),
    [
        (LATE, np.ones(N, dtype=bool)),  # at all times: it tells nothing of this force
        (LATE, AT > 150),  # free of it for half a minute only
        (LATE, ~LATE),
        (LATE, AT > 4600),  # less than half of the time
        (AT % 10 < 5, AT > 600),  # nearly always, and the force does not care
        (AT < 0, LATE),  # no force
        (LATE, AT < 0),  # no fault
    ],
    ids=["always", "nearly always", "never then", "too little", "no odds", "no force", "no fault"],
)
def test_a_fault_that_tells_nothing_of_the_force_is_not_told(
    nothing_missing: Evidence, acting: NDArray[np.bool_], on: NDArray[np.bool_]
) -> None:
    assert told(nothing_missing, np.where(acting, -0.3, 0.0), on) is None


def test_what_nobody_told_counts_for_nothing(nothing_missing: Evidence) -> None:
    """No DM1 for the first recording: neither active there nor free of it."""
    acting = (AT % HALF) > 1500
    spn = np.where(acting, 110.0, 0.0)
    spn[:HALF] = np.nan
    channels = {"fault_spn": spn, "fault_fmi": np.where(np.isnan(spn), np.nan, 16.0)}
    fault = active_fault(np.where(acting, 0.3, 0.0), nothing_missing, recorded(channels, nothing_missing))
    assert fault == ActiveFault(110, 16, 1.0, 0.0)
    assert active_fault(acting * 0.3, nothing_missing, recorded({}, nothing_missing)) is None


class Derated:
    """An engine that gives 60 % from 80 s to 170 s of a drive."""

    def reset(self, batch: int) -> None: ...

    def filter(self, u: Array, time: float, dt: float) -> Array:
        share = 0.6 if 80.0 < time < 170.0 else 1.0
        return np.stack([np.where(u[:, 0] > 0, share * u[:, 0], u[:, 0]), u[:, 1]], axis=1)


@pytest.mark.long
def test_a_derate_that_the_engine_told_is_in_the_verdict_s_words() -> None:
    truck = trucks.load("trucksim")
    drives = []
    for seed in range(3):
        r = driving_cycles.drive(truck.with_forces([], [Derated()]), seconds=240.0, seed=40 + seed)
        on = ((r.time - r.time[0] > 80.0) & (r.time - r.time[0] < 170.0)).astype(float)
        faults = {"derate_active": on, "fault_spn": 1569.0 * on, "fault_fmi": 31.0 * on}
        drives.append(replace(r, channels=r.channels | faults))
    found = mismatch.find_mismatch(truck, drives[:-1], drives[-1:])
    said = json.loads(json.dumps(found.verdict, allow_nan=False))
    jsonschema.validate(said, SCHEMA)
    (first, *_) = said["findings"]
    assert first["active_fault"]["spn"] == 1569 and first["active_fault"]["while_acting"] > 0.8
    assert "The engine's derate (SPN 1569) was active in" in first["says"]
    assert Verdict.read(said).findings[0].active_fault == ActiveFault(**first["active_fault"])

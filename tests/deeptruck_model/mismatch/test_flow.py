"""The whole flow on small drives whose truth is known."""

from __future__ import annotations

import importlib.resources
import json
import re
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from small_drives import TRUCK, LazyBrake, drives

from deeptruck_core.errors import InputError
from deeptruck_model import mismatch
from deeptruck_model.mismatch import Mismatch, find_mismatch
from deeptruck_model.mismatch.folders import APPLIED, applicable
from deeptruck_model.mismatch.prepare.drives import LEFT_OUT
from deeptruck_model.mismatch.report import lines
from deeptruck_model.results import FOUND

SCHEMA = json.loads(importlib.resources.files(mismatch).joinpath("verdict.schema.json").read_text())


def test_slow_brakes_are_named_corrected_and_validated(lazy_brake: Mismatch) -> None:
    v = lazy_brake.result
    first = v.findings[0]
    assert v.kind == "missing_physics"
    assert first.family in ("brakes", "timing")
    assert "brake_lag" in (first.effect, *first.credible_set)
    assert v.fit is not None and v.fit.errors is not None
    assert v.validated
    assert v.fit.errors.after.speed < 0.3 * v.fit.errors.before.speed


def test_a_simulator_that_is_the_truck_has_nothing_missing(right_truck: Mismatch) -> None:
    assert right_truck.result.kind == "nothing_missing"
    assert not right_truck.findings
    assert right_truck.verdict["advice"]["simulator"]["answer"] == "yes"
    assert [r.samples for r in right_truck.result.data.rejected if r.rule == LEFT_OUT] == [
        pytest.approx(300, abs=5)
    ]


def test_a_recorded_mass_that_the_drives_contradict_is_a_caveat(
    lazy_brake: Mismatch, right_truck: Mismatch
) -> None:
    right, wrong = (
        [c for c in found.result.caveats if " states a mass of " in c] for found in (lazy_brake, right_truck)
    )
    assert not right and len(wrong) == 1
    assert "states a mass of 26.0 t, and the drives show 20" in wrong[0]


def test_every_verdict_keeps_to_the_schema(lazy_brake: Mismatch, right_truck: Mismatch) -> None:
    for found in (lazy_brake, right_truck):
        jsonschema.validate(json.loads(json.dumps(found.verdict, allow_nan=False)), SCHEMA)


def test_a_brake_that_was_not_recorded_is_said_beside_every_name_of_the_brakes() -> None:
    recorded = [_without_brake(r) for r in drives(TRUCK.with_forces([], [LazyBrake()]))]
    found = find_mismatch(TRUCK, recorded[:2], recorded[2:3])
    (brake,) = [m for m in found.result.not_recorded if m.input == "brake"]
    assert brake.share_of_time is not None and brake.share_of_time > 0.02
    assert all(f.missing_input == "brake" for f in found.findings if f.family == "brakes")


def _without_brake(r):
    interface = replace(r.interface, brake_unit=None)
    channels = {n: x for n, x in r.channels.items() if n != "brake_command"}
    return replace(r, channels=channels, interface=interface)


def test_files_of_a_result(lazy_brake: Mismatch, tmp_path: Path) -> None:
    mismatch.write(lazy_brake, tmp_path / "found")
    verdict = json.loads((tmp_path / "found" / "verdict.json").read_text())
    assert verdict["schema"] == 3
    rows = (tmp_path / "found" / "profiles.csv").read_text().splitlines()
    assert rows[0] == "recording,time_s,distance_m,name,value"
    assert {row.split(",")[3] for row in rows[1:]} == {f.effect for f in lazy_brake.findings}
    assert (tmp_path / "found" / "simulator" / "simulator.json").exists()
    page = (tmp_path / "found" / "report.html").read_text()
    assert lines.headline(lazy_brake.result) in page
    (first,) = map(json.loads, re.findall(r'"first":({.*?})', page))
    errors = lazy_brake.errors
    most = max(float(np.sqrt(np.mean(errors[key].speed ** 2, axis=1)).max()) for key in ("before", "fitted"))
    assert f"by {most:.2g} m/s (rms)" in page and first["from"] < first["to"]
    assert "http" not in page.replace("http-equiv", "").replace("http://www.w3.org", "")


def test_what_was_written_is_read_again(lazy_brake: Mismatch, tmp_path: Path) -> None:
    mismatch.write(lazy_brake, tmp_path / "found")
    again = mismatch.read(tmp_path / "found").to_json()
    made = {name: lazy_brake.verdict[name] for name in ("regimes", "headline", "sentences")}
    assert again | made == lazy_brake.verdict  # what is made of the rest when it is written


def test_what_is_missing_is_plotted_over_time(lazy_brake: Mismatch) -> None:
    name = lazy_brake.prepared[1].recording.name
    (axes,) = lazy_brake.plot(name).axes
    assert axes.get_title() == name
    legend = axes.get_legend()
    assert legend is not None
    labels = [text.get_text() for text in legend.get_texts()]
    assert labels == ["missing", *(f.effect.replace("_", " ") for f in lazy_brake.findings)]
    assert lazy_brake.plot().axes[0].get_title() == lazy_brake.result.segments[0].recording
    with pytest.raises(InputError, match="there is no recording 'x'"):
        lazy_brake.plot("x")


def test_a_notebook_shows_a_line_and_sentences(lazy_brake: Mismatch) -> None:
    assert repr(lazy_brake).startswith("<Mismatch: missing_physics; ")
    assert len(repr(lazy_brake)) < 200
    assert all(sentence.endswith(".") for sentence in mismatch.summary(lazy_brake))


def test_files_without_a_marker_are_the_users(tmp_path: Path) -> None:
    """They may bear a result's names: without a marker nobody knows who wrote them."""
    for name in ("verdict.json", "report.html", "profiles.csv"):
        (tmp_path / name).write_text("{}")
    for overwrite in (False, True):
        with pytest.raises(InputError, match=r"but no \.deeptruck\.json"):
            FOUND.check(tmp_path, overwrite=overwrite)


def test_one_kind_of_result_does_not_replace_another(tmp_path: Path) -> None:
    with FOUND.replacing(tmp_path / "found") as draft:
        (draft / "verdict.json").write_text("{}")
    with pytest.raises(InputError, match="holds a mismatch result, not a corrected simulator"):
        APPLIED.check(tmp_path / "found", overwrite=True)


def test_what_is_not_there_is_to_be_found_first(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere does not exist; run 'deeptruck-model mismatch' first"):
        applicable(tmp_path / "nowhere")

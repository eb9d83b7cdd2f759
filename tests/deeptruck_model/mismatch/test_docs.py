"""docs/mismatch_effects.md has every effect; the case of docs/mismatch.md runs and ends as written there."""

from __future__ import annotations

import json
import re
import shlex
import sys
from pathlib import Path

import pytest

from deeptruck_model import cli, recordings, trucks
from deeptruck_model.mismatch import LIBRARY
from deeptruck_model.trucks import driving_cycles

DOCS = Path(__file__).parents[3] / "docs"
PAGE, EFFECTS = DOCS / "mismatch.md", DOCS / "mismatch_effects.md"


def test_every_effect_has_a_row() -> None:
    text = EFFECTS.read_text()
    others = ("clock_offset", "speed_scale", "acceleration_bias", "grade_bias", "mass", "torque_gain")
    assert not [name for name in (*LIBRARY, *others) if f"| `{name}`" not in text]


@pytest.mark.long
def test_the_case_ends_as_the_page_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text().partition("## A case to repeat")[2].partition("\n## ")[0]
    (snippet,) = re.findall(r"^```python\n(.*?)^```", text, re.S | re.M)
    exec(compile(snippet, str(PAGE), "exec"), {})
    (commands,) = re.findall(r"^```bash\n(.*?)^```", text, re.S | re.M)
    for line in commands.splitlines():
        monkeypatch.setattr(sys, "argv", shlex.split(line))
        with pytest.raises(SystemExit) as caught:
            cli.main()
        assert not caught.value.code
    said = json.loads(Path("found/verdict.json").read_text())
    assert [f["effect"] for f in said["findings"]] == ["brake_lag"]  # as the page says
    assert said["findings"][0]["probability"] > 0.9
    assert said["findings"][0]["parameters"]["time_constant"]["value"] == pytest.approx(0.6, abs=0.1)
    before, tuned, after = (said["fit"][w]["speed_rmse"] for w in ("before", "parameters_only", "after"))
    stated = re.search(r"falls from ([\d.]+) m/s to ([\d.]+) m/s", PAGE.read_text())
    assert stated and [before, after] == pytest.approx([float(x) for x in stated.groups()], rel=0.15)
    assert tuned > before
    assert Path("better/simulator.json").exists()


@pytest.mark.long
def test_the_example_of_the_readme_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    truck = trucks.load("trucksim").with_parameters({"mass": 30e3})
    for seed, name in enumerate("ad"):
        drive = driving_cycles.drive(truck, seconds=400.0, seed=seed, name=name)
        recordings.write_bag(tmp_path / "drives" / "other" / name, [drive], interface=truck.interface)
    (snippet,) = re.findall(r"^```python\n(.*?)^```", (DOCS.parent / "README.md").read_text(), re.S | re.M)
    exec(compile(snippet, "README.md", "exec"), {})
    assert capsys.readouterr().out.strip() and Path("found_in_a/report.html").exists()

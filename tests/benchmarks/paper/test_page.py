from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks.paper import learning, modelling, page
from benchmarks.paper.drives import TRAIN_SEED, drive_of
from benchmarks.paper.page import Row, at
from benchmarks.paper.run import app
from deeptruck_model import simulators, trucks
from deeptruck_model.errors import InputError

SPEED = Row("speed", "within 1.5", at("speed"), most=1.5)


def test_a_cell_is_the_median_and_bold_where_a_seed_misses() -> None:
    assert SPEED.cell([{"speed": 1.0}]) == "1.00"
    assert SPEED.cell([{"speed": x} for x in (1.0, 1.2, 1.4)]) == "1.20 (1.00 to 1.40)"
    assert SPEED.cell([{"speed": x} for x in (1.0, 1.2, 9.0)]) == "**1.20 (1.00 to 9.00)**"  # one misses
    assert SPEED.cell([{"speed": 2.0}]) == "**2.00**"
    band = Row("band", "-0.5 to 1", at("band", "speed"), -0.5, 1.0)
    assert band.cell([{"band": {"speed": [-0.4, 0.9]}}]) == "-0.40 to 0.90"
    assert band.cell([{"band": {"speed": [-0.6, 0.9]}}]) == "**-0.60 to 0.90**"
    assert band.cell([]) == band.cell([{}]) == "-"
    assert Row("share", "", at("share"), form="{:.0%}").cell([{"share": 0.5}]) == "50 %"


@pytest.mark.parametrize(
    "row",
    [r for rows in modelling.FIELD_ROWS.values() for r in rows if np.isfinite(r.most)],
    ids=lambda r: r.what,
)
def test_a_field_truck_is_held_to_what_the_paper_says(row: Row) -> None:
    """A range, or the largest magnitude; nothing is stated for runs that the paper does not tell apart."""
    numbers = [float(x) for x in re.findall(r"-?[\d.]+", row.paper or "±1")]
    assert (row.least, row.most) == (numbers[0] if len(numbers) == 2 else -numbers[-1], numbers[-1])


def test_a_table_says_how_many_seeds_ran() -> None:
    lines = page.table([SPEED], {"its recipe": [{"speed": 1.0}], "ours": []})
    assert lines[2] == "| seeds | | 1 | not run |" and lines[3] == "| speed | within 1.5 | 1.00 | - |"


def test_a_seed_is_worse_where_it_does_not_beat_the_median() -> None:
    share = Row("share", "", at("share"), better="large")
    count = Row("passes", "", at("passes"), better="")
    ours = [
        {"speed": [-0.9, 0.2], "share": 0.9, "passes": 1},
        {"speed": [-0.1, 1.3], "share": 0.7, "passes": 1},
    ]
    theirs = [{"speed": x, "share": 0.8, "passes": 600} for x in (0.5, 1.0, 2.0)]
    assert page.worse([SPEED, share, count], ours, theirs) == {"speed": 1, "share": 1}
    assert page.worse([SPEED, share, count], ours[:1], theirs) == {}


def test_an_earlier_page_is_continued_and_a_damaged_one_refused(tmp_path: Path) -> None:
    known, out = tmp_path / "known", tmp_path / "out"
    known.mkdir()
    out.mkdir()
    with pytest.raises(InputError, match=r"has no measured.json that can be read"):
        page.restore(out, known)
    (known / "measured.json").write_text('{"volvo-paper-0": {"updates": 3}, "volvo-paper-1": {"updates": 4}}')
    (known / "volvo.png").write_bytes(b"picture")
    (out / "work").mkdir()
    (out / "work/volvo-paper-0.json").write_text("newer")
    page.restore(out, known)
    assert (out / "work/volvo-paper-0.json").read_text() == "newer"
    assert json.loads((out / "work/volvo-paper-1.json").read_text()) == {"updates": 4}
    assert (out / "paper/volvo.png").read_bytes() == b"picture"


@pytest.fixture
def little(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nine minutes of every truck, one of the two field trucks and some of the variants."""
    volvo = {"volvo": modelling.FIELD_ROWS["volvo"]}
    monkeypatch.setattr(modelling, "FIELD_ROWS", volvo)
    few = {name: learning.VARIANTS[name] for name in ("short", "free", "cubic")}
    monkeypatch.setattr(modelling, "VARIANTS", few)
    whole = drive_of("trucksim", 9, TRAIN_SEED)
    monkeypatch.setattr(learning, "drives", lambda truck, as_driven=False: (whole, whole))
    trucksim = trucks.load("trucksim")
    monkeypatch.setattr(trucks, "load", lambda name: trucksim)
    monkeypatch.setattr(modelling, "drives", learning.drives)
    monkeypatch.setattr(learning, "drive_of", lambda *_: whole.piece(0, 600))
    monkeypatch.setattr(modelling, "drive_of", lambda *_: whole)


@pytest.mark.long
@pytest.mark.usefixtures("little")
def test_the_page_has_every_truck_and_recipe_and_goes_on(tmp_path: Path, monkeypatch: Any) -> None:
    command = ["modelling", "--seeds", "1", "--budget", "2", "--out", str(tmp_path)]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    out = tmp_path / "paper"
    assert f"written: {out / 'paper.md'}" in done.output.replace("\n", "")
    page = (out / "paper.md").read_text()
    assert page.count("| seeds | | 1 | 1 | 1 | 1 |") == 2 and page.startswith("# Beside the paper\n\n**")
    assert "### Why the deployment form stays above" in page and "\n| fuel in cm³/s, losses too | " in page
    assert "the deployment form rises in: " in page and "Not run: a quarter of the step, " in page
    assert "| | paper | fuel in l/s | fuel in cm³/s, as printed |" in page
    assert "of the recipe's runs stay within 1.5 m/s.** The recipe never trains" in page
    assert "**Why Volvo's fuel rate misses ±1 cm³/s.**" in page and "either of its two highest gears" in page
    assert "is trained on engine_speed, engine_torque, gear besides" in page
    assert "| our default, not trained on gear and engine | brake pressure | " in page
    for name in (*modelling.CAPTIONS, "volvo.png"):
        assert f"(paper/{name})" in page and (out / "paper" / name).stat().st_size > 5000
    found = json.loads((out / "work" / "trucksim-paper-0.json").read_text())
    assert found["updates"] == 2 and found["auxiliary"] == [] and len(found["curves"]) == 2
    monkeypatch.setattr(learning, "train", None)  # nothing is trained again
    again = CliRunner().invoke(app, command)
    assert again.exit_code == 0 and (out / "paper.md").read_text() == page
    elsewhere = [*command[:-1], str(tmp_path / "elsewhere"), "--known", str(out / "paper")]
    restored = CliRunner().invoke(app, elsewhere)  # nor on another machine
    assert restored.exit_code == 0 and (tmp_path / "elsewhere/paper/paper.md").read_text() == page
    (out / "notes.txt").write_text("mine")
    refused = CliRunner().invoke(app, command)
    assert refused.exit_code != 0 and "notes.txt, which is no part of a page beside" in str(refused.exception)


@pytest.mark.usefixtures("little")
def test_what_a_killed_training_observed_counts_once(tmp_path: Path) -> None:
    job = learning.Job(str(tmp_path), "trucksim", "paper", 0, updates=2)
    killed = '{"updates": 1, "training": [9.0], "deployment": [9.0]}\n'
    tmp_path.joinpath(f"{job.name}.jsonl").write_text(killed)
    curves = learning.learn(job)[0]["curves"]
    assert [line["updates"] for line in curves] == [1, 2] and curves[0]["training"] != 9.0


@pytest.mark.usefixtures("little")
@pytest.mark.parametrize("recipe", ["paper", "default"])
def test_a_seed_in_a_batch_is_the_seed_alone(tmp_path: Path, recipe: str) -> None:
    """Up to the rounding of products of stacked matrices."""
    alone, batch = tmp_path / "alone", tmp_path / "batch"
    (one,) = learning.learn(learning.Job(str(alone), "trucksim", recipe, 1, updates=6))
    two = learning.learn(learning.Job(str(batch), "trucksim", recipe, 0, 2, updates=6))
    assert [found["name"] for found in two] == [f"trucksim-{recipe}-{k}" for k in range(2)]
    for figures in (
        ["errors", "channels", "speed"],
        ["band", "fuel_rate"],
        *([["end"]] if "end" in one else []),
    ):
        for key, values in _at(one, figures).items():
            np.testing.assert_allclose(_at(two[1], figures)[key], values, rtol=1e-3, atol=1e-4)
    assert two[0]["speed"] != two[1]["speed"]
    weights = [
        simulators.load(job / "trucks" / name).network
        for job, name in ((alone, f"trucksim-{recipe}-1"), (batch, f"trucksim-{recipe}-0-1"))
    ]
    np.testing.assert_allclose(*(w.recurrent[-1].detach() for w in weights), rtol=1e-4, atol=1e-5)


def _at(found: Any, path: list[str]) -> Any:
    for key in path:
        found = found[key]
    return found


def test_what_is_measured_is_not_learned_again(tmp_path: Path) -> None:
    for seed in (0, 1, 12):
        kept = {"budget": 0, "errors": {}}
        tmp_path.joinpath(f"volvo-paper-{seed}.json").write_text(json.dumps(kept))
    jobs = learning.to_learn(str(tmp_path), "volvo", "paper", 25)
    assert [(job.first, job.seeds) for job in jobs] == [(2, 10), (13, 10), (23, 2)]
    assert jobs[0].name == "volvo-paper-2-11" and jobs[0].names[-1] == "volvo-paper-11"
    assert len(learning.to_learn(str(tmp_path), "volvo", "paper", 2, updates=5)) == 1  # of another budget

"""Running many cases and writing the page."""

import json

import pytest

from deeptruck_exam.jobs import Job, run_jobs
from deeptruck_exam.scoring.figures import wilson
from deeptruck_exam.scoring.page import write_page
from deeptruck_exam.scoring.scoreboard import by_level, rare_by_information


def result(level, true, said, seed=0, **more):
    right = bool(true) and said[:1] == true
    return {
        "level": level,
        "seed": seed,
        "simulator": "physics",
        "true": true,
        "keys": true,
        "said": said,
        "verdict": "missing_physics" if said else "nothing_missing",
        "outcome": "right"
        if right
        else ("wrong" if said and true else "silent" if not said else "false_alarm"),
        "right_first": right,
        "in_group": right,
        "set_size": 1 if true and said else None,
        "log_score": -0.2 if right else -3.0,
        "recall": float(right),
        "precision": float(right) if said else None,
        "recognised_unknown": None,
        "input_stated": None,
        "each_drive_found": None,
        "overlap": 0.5 if true else None,
        "intervals": [],
        "information_nats": 200.0,
        "information_left_nats": 150.0,
        "share_of_time": 0.1,
        "seconds": 3.0,
        **more,
    }


RESULTS = [
    result("noise", ["brake_fade"], ["brake_fade"], share={"tool": 0.9, "parameters_only": 0.5}),
    result("noise", ["headwind"], ["drag_area"], 1, share={"tool": 0.2, "parameters_only": 0.5}),
    result("nothing_missing", [], [], 2),
    result("nothing_missing", [], ["headwind"], 3),
    result("rare", ["headwind"], [], 4, information_nats=20.0),
]


def test_rates_by_level():
    table = by_level(RESULTS)
    noise, null = table["physics", "noise"], table["physics", "nothing_missing"]
    assert (noise["n"], noise["right first"], noise["beats refit"]) == (2, 0.5, 0.5)
    assert noise["share of oracle"] == pytest.approx(0.55)
    assert (null["false statement"], null["right first"]) == (0.5, None)
    assert rare_by_information(RESULTS)["too little, silent"] == 1.0


def test_wilson_interval_holds_the_rate_and_shrinks():
    assert wilson(0.0, 40)[0] == 0.0 and 0.05 < wilson(0.0, 40)[1] < 0.12
    assert wilson(0.5, 10)[1] - wilson(0.5, 10)[0] > wilson(0.5, 1000)[1] - wilson(0.5, 1000)[0]


def test_the_page_names_failures_and_shows_figures(tmp_path):
    broken = {"level": "noise", "seed": 9, "simulator": "physics", "broken": "Traceback\nValueError: x"}
    board = write_page([*RESULTS, broken], tmp_path, "prove")
    text = (tmp_path / "proof.md").read_text()
    for name in ("confusion.png", "levels.png", "improvement.png"):
        assert name in text and (tmp_path / name).stat().st_size > 5000
    assert json.loads((tmp_path / "scoreboard.json").read_text()) == board


def test_scored_cases_are_not_made_again_and_broken_ones_do_not_stop_the_rest(tmp_path):
    done = Job("noise", 1)
    (tmp_path / done.folder).mkdir()
    (tmp_path / done.folder / "score.json").write_text(json.dumps(RESULTS[0]))
    one, two = run_jobs(tmp_path, [done, Job("no_such_level", 2)])
    assert one == RESULTS[0]
    assert "no_such_level" in two["broken"]

"""Rules of scoring, on verdicts written by hand."""

import json
import math

import pytest

from deeptruck_exam.jobs import Job, run_jobs
from deeptruck_exam.scoring import score
from deeptruck_exam.scoring.page import write_page
from deeptruck_exam.scoring.score import improvement, overlap, score_events, score_intervals, score_names
from deeptruck_exam.scoring.scoreboard import by_level, rare_by_information


def truth(*names, **more):
    effects = [{"name": n, "key": n, "accepts": [], "comparable": {}} for n in names]
    known = {"verdict": "missing_physics", "segments": [], "not_recorded": "", "each_drive": False}
    return {"effects": effects, **known, **more}


def spans(*rows):
    return [{"recording": n, "start_s": a, "end_s": b} for n, a, b in rows]


def verdict(*findings, kind="missing_physics"):
    return {
        "verdict": kind,
        "findings": [
            {"effect": f, "credible_set": []}
            if isinstance(f, str)
            else {"effect": f[0], "credible_set": list(f[1:])}
            for f in findings
        ],
    }


@pytest.mark.parametrize(
    ("said", "outcome", "first", "in_group"),
    [
        (["brake_fade"], "right", True, True),
        (["brake_fade", "headwind"], "right", True, True),
        ([("brake_gain", "brake_fade")], "group", False, True),
        (["headwind", "brake_fade"], "wrong", False, False),
        (["unknown"], "unknown", False, False),
        ([], "silent", False, False),
    ],
)
def test_names(said, outcome, first, in_group):
    result = score_names(truth("brake_fade"), verdict(*said))
    assert (result["outcome"], result["right_first"], result["in_group"]) == (outcome, first, in_group)


def test_a_tool_that_wrote_nothing_failed():
    assert score_names(truth("brake_fade"), {})["outcome"] == "failed"
    assert score_names(truth(), {})["outcome"] == "failed"


def test_nulls():
    quiet = score_names(truth(), verdict(kind="nothing_missing"))
    loud = score_names(truth(), verdict("headwind"))
    assert (quiet["outcome"], loud["outcome"]) == ("silent", "false_alarm")


def test_several():
    result = score_names(truth("brake_fade", "headwind"), verdict("headwind", "turbo_lag"))
    assert (result["recall"], result["precision"], result["false_names"]) == (0.5, 0.5, ["turbo_lag"])


def test_unknown_counts_only_as_a_finding_of_its_own():
    asked = truth("unknown")
    assert score.recognised_unknown(asked, verdict("unknown"))
    assert score.recognised_unknown(asked, verdict("headwind", "unknown"))
    assert not score.recognised_unknown(asked, verdict(("headwind", "unknown")))
    assert score_names(asked, verdict(("headwind", "unknown")))["outcome"] == "wrong"
    assert not score.recognised_unknown(asked, verdict("headwind"))
    assert score.recognised_unknown(truth("headwind"), verdict("headwind")) is None


def test_large_groups_and_probabilities_that_are_too_sure_cost():
    def first(probability, *names):
        said = verdict(names)
        said["findings"][0]["probability"] = probability
        return score_names(truth("brake_fade"), said)

    alone, beside, among = (
        first(0.8, "brake_fade"),
        first(0.6, "headwind", "brake_fade"),
        first(0.6, "a", "b", "brake_fade"),
    )
    assert (alone["set_size"], beside["set_size"], among["set_size"]) == (1, 2, 3)
    assert alone["log_score"] == pytest.approx(math.log(0.8))
    assert beside["log_score"] == pytest.approx(math.log(0.4 * 0.9))
    assert among["log_score"] == pytest.approx(math.log(0.2 * 0.9))
    assert first(0.9, "headwind")["log_score"] < first(0.5, "headwind")["log_score"] < beside["log_score"]


def test_the_probabilities_of_all_names_are_one_together():
    (finding,) = verdict(("a", "b", "c"))["findings"]
    finding["probability"] = 0.7
    others = score.NAMES - 1 - 2
    assert sum(score.probability_of(n, [finding]) for n in "abc") + others * score.probability_of(
        "x", [finding]
    ) == pytest.approx(1.0)
    assert score.probability_of("nothing", []) + (score.NAMES - 1) * score.probability_of(
        "a", []
    ) == pytest.approx(1.0)


def test_events_are_located_by_half_and_false_where_they_overlap_nothing():
    rare = truth("x", segments=spans(("a", 0, 6), ("b", 10, 16), ("b", 30, 36))) | {"level": "rare"}
    found = {"events": spans(("a", 3, 9), ("b", 14, 16), ("b", 50, 60))}
    assert score_events(rare, found) == {"true": 3, "located": 1, "false": 1}
    assert score_events(rare | {"level": "noise"}, found) == {"true": 0, "located": 0, "false": 1}
    assert score_events(rare, {}) == {"true": 3, "located": 0, "false": 0}


def test_overlap_of_segments():
    asked = truth("x", segments=spans(("a", 0, 10), ("b", 0, 10)))
    assert overlap(asked, {"segments": spans(("a", 0, 10), ("b", 0, 10))}) == 1.0
    assert overlap(asked, {"segments": spans(("a", 0, 6), ("a", 4, 10))}) == pytest.approx(0.5)
    assert overlap(asked, {"segments": spans(("a#1", 5, 15))}) == pytest.approx(5 / 25)
    assert overlap(asked, {"segments": []}) == 0.0
    assert overlap(truth("x"), {"segments": spans(("a", 0, 1))}) is None


def test_intervals_are_compared_under_the_same_name_only():
    asked = truth("mass")
    asked["effects"][0]["comparable"] = {"mass": {"value": 20000.0, "unit": "kg"}}
    said = verdict("mass", "headwind")
    said["findings"][0]["parameters"] = {
        "mass": {"value": 19000.0, "unit": "kg", "ci95": [18000.0, 20500.0]},
        "other": {"value": 1.0, "unit": "1", "ci95": [0.0, 2.0]},
    }
    (one,) = score_intervals(asked, said)
    assert one["holds"] and one["true"] == 20000.0
    said["findings"][0]["parameters"]["mass"]["ci95"] = [18000.0, 19900.0]
    assert not score_intervals(asked, said)[0]["holds"]
    one = said["findings"][0]["parameters"].pop("mass")
    said["findings"][0]["parameters"]["extra"] = one
    assert score_intervals(asked, said)[0]["value"] == 19000.0
    said["findings"][0]["parameters"]["further"] = one
    assert score_intervals(asked, said) == []


def test_improvement_is_a_share_of_the_oracles():
    errors = {name: {"speed_rmse": v} for name, v in (("before", 2.0), ("oracle", 1.0), ("tool", 1.25))}
    assert improvement(errors) == {"tool": pytest.approx(0.75)}
    errors["oracle"]["speed_rmse"] = 1.99
    assert improvement(errors) == {}


def test_a_withheld_input_must_be_stated_and_no_name_given_that_it_explains():
    asked = truth(not_recorded="slope", may_be_named=["road_grade"])
    says = {"not_recorded": [{"input": "slope", "hides": "", "signal": ""}]}
    assert score.input_stated(asked, {**verdict(), **says})
    assert score.input_stated(asked, {**verdict("road_grade"), **says})
    assert not score.input_stated(asked, {**verdict("headwind"), **says})
    assert not score.input_stated(asked, verdict())
    assert score.input_stated(truth("headwind"), verdict("headwind")) is None


def test_a_tool_that_refuses_must_name_the_input():
    asked = truth(not_recorded="brake", may_be_named=[])
    assert score.input_stated(asked, {}, "recording 'a' has no valid brake_command")
    assert not score.input_stated(asked, {}, "Traceback")


def test_what_differs_between_drives_is_the_largest_part_of_the_budget():
    asked = truth("headwind", each_drive=True)

    def budget(**parts):
        return {"budget": {"parts": [{"part": n, "share": v} for n, v in parts.items()]}}

    assert score.each_drive_found(asked, {**verdict(), **budget(each_drive=0.4, slow=0.1, left_over=0.5)})
    assert not score.each_drive_found(asked, {**verdict("headwind"), **budget(each_drive=0.1, slow=0.4)})
    assert score.each_drive_found(asked, verdict("headwind")) and not score.each_drive_found(asked, verdict())
    assert score.each_drive_found(truth("headwind"), verdict()) is None


# Many cases and the page


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

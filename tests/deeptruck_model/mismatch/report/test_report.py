"""The page: complete for every verdict, offline, legible, and without anything that is not a number."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from found_mismatches import VERDICTS, mismatch
from pages import Page, pixels

from deeptruck_model.mismatch.fit_result import HandedOver
from deeptruck_model.mismatch.posterior import formula
from deeptruck_model.mismatch.report import headline, names, what_now, wording
from deeptruck_model.mismatch.report import page as report
from deeptruck_model.mismatch.report.given import record_next
from deeptruck_model.mismatch.report.what_now import Asked
from deeptruck_model.mismatch.result import SmallestVisible

ASKED = Asked(Path("my found"), "truck:trucksim", (Path("a"), Path("b")), (Path("c"),))


def _sentences(verdict):
    """The headline, and what follows it in one paragraph."""
    first, *more = headline.sentences(headline.of(verdict))
    return [first, *([" ".join(more)] if more else [])]


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Folder of each verdict's page, written once."""
    out = {}
    for kind in VERDICTS:
        folder = tmp_path_factory.mktemp(kind)
        found = mismatch(kind)
        report.write(found, folder, ASKED)
        out[kind] = SimpleNamespace(
            folder=folder, found=found, html=(folder / "report.html").read_text("utf-8")
        )
    return out


@pytest.mark.parametrize("kind", VERDICTS)
class TestEveryVerdict:
    def test_the_sentence_comes_first(self, written, kind):
        page = Page(written[kind].html)
        expected = _sentences(written[kind].found.result)
        assert page.text[: len(expected)] == expected
        assert page.tags[page.tags.index("body") + 1] == "h1"
        assert page.text[0].endswith(".")

    def test_no_sentence_is_long(self, written, kind):
        for text in Page(written[kind].html).text:
            if text.endswith("."):
                for sentence in re.split(r"(?<=[.!?]) ", text):
                    assert len(sentence.split()) <= names.LONGEST, sentence

    def test_nothing_is_fetched(self, written, kind):
        source = written[kind].html
        page = Page(source)
        assert page.fetched == []
        assert page.images
        assert all(image.startswith("data:image/png;base64,") for image in page.images)
        assert not {"link", "iframe", "object", "embed", "base"} & set(page.tags)
        assert not re.search(
            r"(?:https?|wss?|file):|fetch\(|XMLHttpRequest|import\(|sendBeacon|WebSocket", source
        )
        assert "default-src 'none'" in source
        style = source[source.index("<style>") : source.index("</style>")]
        assert "url(" not in style
        assert "@import" not in style

    def test_every_figure_shows_something_and_lies_beside_the_page(self, written, kind):
        embedded = [base64.b64decode(s.partition(",")[2]) for s in Page(written[kind].html).images]
        files = {p.read_bytes() for p in written[kind].folder.glob("*.png")}
        others = {p.read_bytes() for p in written[kind].folder.glob("*.png") if p.stem != "timeline"}
        assert others <= set(embedded)
        timeline = pixels((written[kind].folder / "timeline.png").read_bytes())
        strips = [pixels(png) for png in embedded if png not in others]
        np.testing.assert_array_equal(np.concatenate(strips), timeline)
        assert (written[kind].folder / "coverage.png").exists()
        for png in files | set(embedded):
            shades = pixels(png)[..., :3]
            assert min(shades.shape[:2]) > 100
            assert shades.std() > 0.02
            assert len(np.unique(shades.reshape(-1, 3)[::7], axis=0)) > 8

    def test_no_value_is_missing(self, written, kind):
        text = " ".join(Page(written[kind].html).text)
        assert not re.search(r"\b(nan|inf|None|NaN|undefined|Infinity|True|False)\b", text)
        assert "{{" not in text
        assert "array(" not in text

    def test_what_to_record_next_and_caveats_are_there(self, written, kind):
        text = Page(written[kind].html).text
        assert "Caveats" in text
        assert "What to record next" in text


def text_of(written, kind: str) -> str:
    return " ".join(Page(written[kind].html).text)


def test_what_to_do_now_can_be_copied(written):
    text = Page(written["missing_physics"].html).text
    assert "deeptruck-model apply 'my found' --out 'my found_corrected'" in text
    again = "--simulator truck:trucksim --recordings a b NEW_DRIVE --held-out c --out 'my found_again'"
    assert f"deeptruck-model mismatch {again}" in text
    assert text.index("What to do now") < text.index("Findings")
    assert not any("deeptruck-model apply" in t for t in Page(written["nothing_missing"].html).text)


def test_a_call_from_python_is_not_repeated():
    found = mismatch("missing_physics")
    steps = what_now.steps(found, record_next(found), Asked(Path("found")))
    assert [s.command for s in steps] == ["deeptruck-model apply found --out found_corrected", ""]


def test_what_the_road_has_is_not_said_to_be_the_truck():
    found = mismatch("missing_physics")
    alone = HandedOver(("place",), 0.6)
    by_place = replace(found, result=replace(found.result, fit=replace(found.result.fit, handed_over=alone)))
    for told, says in ((found, what_now.TAKE_OVER), (by_place, what_now.TAKE_OVER_BY_PLACE)):
        assert what_now.steps(told, [], Asked(Path("found")))[0].says == says


@pytest.mark.parametrize(("kind", "first"), [("nothing_missing", True), ("missing_physics", False)])
def test_a_simulator_that_leaves_nothing_out_is_to_be_used(kind, first):
    found = mismatch(kind)
    steps = what_now.steps(found, record_next(found), Asked(Path("found")))
    assert (steps[0].says == what_now.AS_IT_IS) == first


def test_a_call_is_repeated_with_its_topic_map():
    asked = Asked(Path("found"), "truck:trucksim", (Path("a"),), topic_map=Path("my topics.yaml"))
    again = "--simulator truck:trucksim --recordings a --topic-map 'my topics.yaml' --out found_again"
    assert asked.command(ending="again") == f"deeptruck-model mismatch {again}"


@pytest.mark.parametrize(
    ("recordings", "held_out", "told"),
    [
        ("ab", "b", "--recordings a --held-out b"),
        ("a", "a", "--recordings a --out"),
        ("ab", "", "--recordings a b --out"),
        ("aab", "bb", "--recordings a --held-out b --out"),
    ],
)
def test_what_is_fitted_and_held_out_too_is_proposed_once(recordings, held_out, told):
    asked = Asked(Path("found"), "truck:trucksim", tuple(map(Path, recordings)), tuple(map(Path, held_out)))
    assert told in asked.command(ending="again")


def test_a_group_is_told_with_what_decided_and_the_manoeuvre(written):
    text = text_of(written, "missing_physics")
    assert "It is not distinguishable from dragging brake." in text
    assert "Brake fade or dragging brake" in text
    assert "What decided: against dragging brake" in text
    assert "To tell brake fade from dragging brake:" in text


def test_sizes_come_with_their_interval(written):
    assert re.search(r"mass 2\d{4} kg \(95 %: 2\d{4} to 2\d{4}\)", text_of(written, "parameter_error"))


def test_an_unknown_force_shows_its_formula_and_shape(written):
    text = text_of(written, "unknown")
    assert "F = 1600 * sin(0.5 * speed)" in text
    assert (written["unknown"].folder / "unknown.png").exists()
    assert "80 % of the variance of these laws, on held-out recordings" in text


def test_nothing_missing_says_what_would_have_been_seen(written):
    text = text_of(written, "nothing_missing")
    assert "a steady force above 81.2 N, or " in text and "for 2 % of the time, would have been seen." in text
    assert "The smallest effect that would have been seen" in text
    assert "mass 2.0 %" in text


def test_a_parameter_that_would_never_have_been_seen_is_not_given_as_a_size():
    """A page gave 60 % of the mass as what would have been seen; it was the largest that had been tried."""
    rows = report.smallest(SmallestVisible({"mass": 0.6, "drag_area": 0.123}, 0.1, 0.4, None))
    told = {row["name"]: row["size"] for row in rows}
    assert (told["mass"], told["drag area"]) == ("more than 60 %; larger ones were not tried", "12 %")


def test_a_sensor_fault_shows_the_sensors_against_each_other(written):
    assert (written["measurement_fault"].folder / "sensors.png").exists()
    assert text_of(written, "measurement_fault").startswith("A sensor is at fault, not the truck model:")


def test_undetermined_gives_the_reason_and_draws_no_model(written):
    folder = written["undetermined"].folder
    assert {p.name for p in folder.glob("*.png")} == {"timeline.png", "coverage.png"}
    assert "The speed is constant throughout" in text_of(written, "undetermined")


def test_before_and_after_show_parameters_only_beside(written):
    text = text_of(written, "missing_physics")
    rows = r"before: [^.]* 0.6 0.05 parameters only: [^.]* 0.4 0.05 after: [^.]* 0.1 0.05"
    assert re.search(rows, text)
    assert "Yes, it is 50 to 80 % smaller" in text and "is 10 to 30 % smaller" in text
    assert "speed error falls from 0.6 to 0.1 m/s. This is the error of 20 s free runs" in text
    assert "with all parameters refitted instead it is 0.4 m/s." in text


def test_names_that_cannot_be_tested_are_told_with_the_signal_that_lacks(written):
    assert re.search(r"Not tested without [^.]*gap[^.]*: drafting", text_of(written, "missing_physics"))


def test_names_of_recordings_are_text_and_not_markup(written):
    assert "<0>" not in written["missing_physics"].html


def test_more_than_a_dozen_recordings_are_counted_but_not_all_drawn(tmp_path):
    report.write(mismatch("missing_physics", count=13), tmp_path, ASKED)
    assert "1 more recording is not drawn" in (tmp_path / "report.html").read_text("utf-8")
    height = pixels((tmp_path / "timeline.png").read_bytes()).shape[0]
    assert height < 110 * (12 * 2.9 + 1.0)
    assert (tmp_path / "report.html").stat().st_size < 4_000_000


def test_the_formula_enters_from_the_evidence():
    found = mismatch("unknown", count=6)
    law = formula.formula(found.evidence, found.explanation)
    assert law.drivers[0] == "speed"
    assert "sin" in law.text
    assert law.held_out_r2 > 0.7


@pytest.mark.parametrize(
    ("value", "unit", "ci", "text"),
    [
        (22997.7, "kg", [22836.6, 23158.8], "23000 kg (95 %: 22840 to 23160)"),
        (0.0826, "1", [0.054, 0.111], "0.083 (95 %: 0.054 to 0.111)"),
        (0.0011, "1/K", None, "0.0011 1/K"),
        (0.0, "N", [0.0, 0.0], "0 N"),
        (40.0, "s", None, "40 s"),
        (float("nan"), "N", [float("nan"), 1.0], "unknown N"),
    ],
)
def test_digits_follow_the_interval(value, unit, ci, text):
    assert wording.measured(value, unit, ci) == text


def test_certainty_is_never_claimed():
    assert wording.percent(1.0) == "above 99 %"
    assert wording.percent(0.0) == "below 1 %"
    assert wording.percent(0.5) == "50 %"

"""Trucks compared, pooled and shown: equal bytes when done twice, and a page that lists what differs."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote

import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import trucks
from deeptruck_model.fleet import page, pool
from deeptruck_model.fleet.compare import DONE, PREVIOUS, VERDICT, VERDICTS, Comparison, chosen, folder
from deeptruck_model.fleet.extract import INDEX, RECEIPTS
from deeptruck_model.fleet.plan import Truck
from deeptruck_model.fleet.run import Fleet, Workers, compare, extract
from deeptruck_model.fleet.storage import place
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.recordings import write_bag
from deeptruck_model.trucks import driving_cycles

LAYOUT = "{truck}/{date}/*.mcap"
SOUND_NATS = {"drag_area": -1.0, "brake_gain": -1.2, "headwind": -2.0}


def receipt(truck: str, nats: dict[str, float]) -> dict[str, object]:
    return {
        "truck": truck, "key": "k", "simulator": "truck:trucksim", "hours_fitted": 2.0, "hours_held_out": 1.0,
        "nats_fitted": nats, "nats_held_out": nats, "weeks": {"2026-W10": 0.004, "2026-W11": 0.02},
    }  # fmt: skip


def verdict(effect: str | None) -> dict[str, object]:
    finding = {
        "effect": effect, "family": "air_tyres_road", "stated": effect, "depends_on": ["speed"],
        "parameters": {"change": {"value": 20.0, "unit": "percent", "ci95": [18.0, 22.0]}},
    }  # fmt: skip
    tree = {"node": "air_tyres_road" if effect else "nothing", "parent": "mismatch", "probability": 0.97}
    kind = "parameter_error" if effect else "nothing_missing"
    return {"verdict": kind, "findings": [finding] if effect else [], "tree": [tree]}


@pytest.fixture
def result(tmp_path) -> Path:
    """What extract and compare leave of 44 trucks, of which four have more drag."""
    target = place(str(tmp_path / "result"))
    for k in range(44):
        name, affected = f"truck {k:02d}", k % 11 == 0
        own = {"drag_area": 40.0 + k, "headwind": 30.0} if affected else {"drag_area": -1.0 - k / 99}
        nats = SOUND_NATS | own
        target.write_json(f"{folder(name)}/{DONE}", receipt(name, nats))
        target.write_json(f"{folder(name)}/verdict.json", verdict("drag_area" if affected else None))
        target.write(f"{folder(name)}/report.html", b"<!doctype html><title>report</title>")
    index = {"total": {"files": 90, "bytes": 1, "hours": 132.0}, "failed": {}, "trucks": {}}
    target.write_json(INDEX, index | {"quarantined": {"x/y.mcap": "it is cut off <here>"}})
    return tmp_path / "result"


def test_the_affected_are_discovered_and_shares_have_intervals(result):
    loads = {f"truck {k:02d}": {"load": "bulk" if k % 2 else "parcels"} for k in range(44)}
    found = pool.pool(place(str(result)), {n: Truck(n, traits=t) for n, t in loads.items()}, 0.05)
    differ = [n for n, t in found["trucks"].items() if t["differs"]]
    assert differ == ["truck 00", "truck 11", "truck 22", "truck 33"]
    of = found["classes"]["all"]
    assert (of["references"], of["tested"], of["references_needed"]["4"]) == (40, 4, 19)
    shares = {(e["trait"], e["value"]): e for e in found["effects"]}
    assert shares["load", "bulk"]["differ"] == shares["load", "parcels"]["differ"] == 2
    low, high = shares["all", "all"]["share"][1:]
    assert low < 4 / 44 < high
    (size,) = found["sizes"]
    assert size["mean"] == pytest.approx(20.0) and set(size["trucks"]) == set(differ)


def test_what_stands_out_is_said_before_what_is_established(result):
    found = pool.pool(place(str(result)), {}, 0.05)
    none = {**found, "trucks": {n: {**e, "differs": False} for n, e in found["trucks"].items()}}
    first, second = pool.headline(none)
    assert first == pool.headline(found)[0] and "stand out by" in first
    assert second == "none is established to differ, which takes 19 references in a class"
    alike = {n: {**e, "role": "reference", "differs": False} for n, e in found["trucks"].items()}
    nothing = {**found, "trucks": alike, "classes": {}}
    assert pool.headline(nothing) == (
        "none of 44 trucks differs from its siblings",
        "none is established to differ",
    )


def test_what_is_of_a_place_and_who_has_no_drives_is_said(result):
    target = place(str(result))
    for name in ("truck 00", "truck 11"):
        of_a_road = verdict("road_grade")
        of_a_road["findings"][0]["depends_on"] = list(LIBRARY["road_grade"].depends_on)
        target.write_json(f"{folder(name)}/{VERDICT}", of_a_road)
    found = pool.pool(target, {"truck XX": Truck("truck XX")}, 0.05)
    assert {s["effect"] for s in found["sizes"]} == {"drag_area"}
    assert found["without_drives"] == ["truck XX"]


def test_a_family_of_one_truck_of_two_is_not_of_most(tmp_path):
    target = place(str(tmp_path / "two"))
    target.write_json(INDEX, {"total": {}, "failed": {}, "trucks": {}, "quarantined": {}})
    for name, effect in (("a", "drag_area"), ("b", None)):
        target.write_json(f"{folder(name)}/{DONE}", receipt(name, SOUND_NATS))
        target.write_json(f"{folder(name)}/{VERDICT}", verdict(effect))
    assert pool.pool(target, {}, 0.05)["classes"]["all"]["common"] == {}


def test_the_page_lists_them_first_and_every_link_leads_to_a_report(result):
    target = place(str(result))
    pool.pool(target, {}, 0.05)
    page.show(target)
    text = (result / page.PAGE).read_text()
    heading = re.search("<h1>(.+?)</h1>", text)[1]
    assert heading.startswith("Of 44 trucks truck 00, truck 11, truck 22, truck 33 stand out by ")
    assert "nats of held-out evidence, their siblings have" in heading
    assert "Established to differ, at a false discovery rate of 0.05: truck 00, truck 11" in text
    assert "it is cut off &lt;here&gt;" in text
    assert text.index("truck 33") < text.index("truck 01") and "2026-W11" in text
    links = {unquote(link) for link in re.findall(r'href="([^"]+)"', text)}
    assert len(links) == 44 and all((result / link).is_file() for link in links)


def test_a_truck_that_differs_without_a_finding_of_its_own_is_listed_with_its_verdict(result):
    target = place(str(result))
    target.write_json(f"{folder('truck 33')}/{VERDICT}", verdict(None))
    pool.pool(target, {}, 0.05)
    page.show(target)
    first = (result / page.PAGE).read_text()
    first = first[first.index("Look at these") : first.index("Trucks by families")]
    assert "<td>differs</td><td>nothing missing</td>" in first


def test_the_page_shows_earlier_and_present_result_where_they_differ(result):
    target = place(str(result))
    for name, effect in (("truck 11", None), ("truck 22", "drag_area")):
        earlier = receipt(name, SOUND_NATS) | {"hours_fitted": 1.0, "weeks": {"2026-W10": 0.004}}
        target.write_json(f"{folder(name)}/{PREVIOUS}", earlier | {VERDICT: verdict(effect)})
    pool.pool(target, {}, 0.05)
    page.show(target)
    text = (result / page.PAGE).read_text()
    assert "2 trucks have an earlier result" in text and "of 1 the result is another now" in text
    changed = text[text.index("What changed") : text.index("Trucks by families")]
    assert "truck 11" in changed and "truck 22" not in changed
    assert changed.index("nothing missing") < changed.index("parameter error: ")
    assert "2.0 h until 2026-W10" in changed and "3.0 h until 2026-W11" in changed


def test_the_page_lists_what_each_run_with_new_drives_discovered(result):
    target = place(str(result))
    pool.pool(target, {}, 0.1)
    page.show(target)
    assert "Discovered run by run" not in (result / page.PAGE).read_text()
    later = receipt("truck 05", SOUND_NATS | {"drag_area": 60.0}) | {"key": "later"}
    target.write_json(f"{folder('truck 05')}/{DONE}", later)
    first, second = pool.pool(target, {}, 0.1)["series"]
    assert len(first["discovered"]) == 4 and list(second["p"]) == ["truck 05"]
    page.show(target)
    rows = re.findall("<tr>(.*?)</tr>", (result / page.PAGE).read_text().partition("run by run</h2>")[2])
    assert "truck 00, truck 11, truck 22, truck 33" in rows[1] and "<td>truck 05</td>" in rows[2]


def test_a_plain_folder_of_verdicts_has_a_page_too(result, tmp_path):
    shutil.copytree(result / VERDICTS, tmp_path / "runs")
    page.show(place(str(tmp_path / "runs")))
    assert "4 of 44 results have a finding" in (tmp_path / "runs" / page.PAGE).read_text()
    page.show(place(str(tmp_path / "runs")))
    (tmp_path / "runs" / page.PAGE).write_text("mine")
    with pytest.raises(InputError, match="was not written by 'fleet show'"):
        page.show(place(str(tmp_path / "runs")))


@pytest.mark.long
def test_of_a_source_that_grew_the_new_file_and_its_truck_alone_are_done(drives, tmp_path):
    source, out = tmp_path / "drives", tmp_path / "out"
    shutil.copytree(drives, source)

    def written() -> dict[str, int]:
        extract(Fleet.of(place(str(source)), place(str(out)), LAYOUT, "truck:trucksim"), Workers())
        compare(place(str(out)), Workers())
        receipts = (p for p in out.rglob("*.json") if p.parent.name == RECEIPTS or p.name in (DONE, PREVIOUS))
        return {p.relative_to(out).as_posix(): p.stat().st_mtime_ns for p in receipts}

    before = written()
    drive = driving_cycles.drive(trucks.load("trucksim"), seconds=40, seed=9)
    write_bag(tmp_path / "bag", [drive], interface=drive.interface)
    (source / "a" / "2026-03-16").mkdir()
    next((tmp_path / "bag").glob("*.mcap")).rename(source / "a" / "2026-03-16" / "drive.mcap")
    after = written()
    new = {name for name in after.keys() - before.keys() if not name.startswith(RECEIPTS)}
    assert len(after) == len(before) + 2 and new == {f"{folder('a')}/{PREVIOUS}"}
    assert {name for name in before if after[name] != before[name]} == {f"{folder('a')}/{DONE}"}


def test_hours_are_whole_drives_over_all_dates():
    drives = [{"date": f"2026-03-{k:02d}", "name": f"{k}", "hours": 1.0} for k in range(1, 21)]
    kept = chosen(drives, 5.0)
    assert len(kept) == 5 and kept == sorted(kept, key=lambda d: d["date"])
    assert chosen(drives, None) == drives and len(chosen(drives, 100.0)) == 20


@pytest.mark.long
def test_compared_twice_it_has_equal_bytes_and_is_skipped_the_third_time(drives, content, tmp_path):
    one, two = tmp_path / "one", tmp_path / "two"
    for out in (one, two):
        extract(Fleet.of(place(str(drives)), place(str(out)), LAYOUT, "truck:trucksim"), Workers())
        compare(place(str(out)), Workers())
    assert content(one, VERDICTS) == content(two, VERDICTS)
    before = {p: p.stat().st_mtime_ns for p in (one / VERDICTS).rglob("*")}
    compare(place(str(one)), Workers())
    assert {p: p.stat().st_mtime_ns for p in (one / VERDICTS).rglob("*")} == before
    receipt = next(p for p in before if p.name == DONE)
    mine, report = receipt.with_name("notes.txt"), receipt.with_name("report.html")
    mine.write_text("mine")
    report.write_text("of an earlier code")
    receipt.write_text(json.dumps(json.loads(receipt.read_text()) | {"key": "earlier"}))
    compare(place(str(one)), Workers())
    assert mine.read_text() == "mine" and report.read_bytes() == (two / report.relative_to(one)).read_bytes()


def test_a_truck_is_compared_again_for_a_page_with_other_units(tmp_path: Path) -> None:
    job = Comparison("t", (), "truck:trucksim", None, place(str(tmp_path)))
    assert job.key == replace(job, units="m/s").key != replace(job, units="km/h").key

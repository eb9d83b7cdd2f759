"""Sides beside one another: their offsets, the road they share, and what is told of them in numbers."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from deeptruck_core.errors import InputError
from deeptruck_model import cli, simulators, trucks
from deeptruck_model.compare import compare, page, statistics, write
from deeptruck_model.compare.alignment import By, Road, road
from deeptruck_model.compare.comparison import Comparison
from deeptruck_model.compare.sides import Side
from deeptruck_model.recordings import Recording, read, write_bag
from deeptruck_model.recordings.units import metres_per_degree
from deeptruck_model.simulators import free_run
from deeptruck_model.trucks import driving_cycles

TRUCK = trucks.load("trucksim")
RUN = CliRunner()
CHROMIUM = next(
    (p for n in ("chromium", "chromium-browser", "google-chrome") if (p := shutil.which(n))), None
)


def put(bag: Path, recording: Recording) -> Path:
    write_bag(bag, [recording], interface=recording.interface)
    return bag


@pytest.fixture(scope="module")
def drive() -> Recording:
    return driving_cycles.drive(TRUCK, seconds=420.0, seed=3)


@pytest.fixture(scope="module")
def bags(drive: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The drive, all but its first 40 s, another drive, and the same with positions on a straight road."""
    folder = tmp_path_factory.mktemp("bags")
    put(folder / "whole", drive)
    put(folder / "later", drive.piece(400, len(drive)))
    put(folder / "other", driving_cycles.drive(TRUCK, seconds=500.0, seed=9))
    north = np.cumsum(drive.channels["speed"]) * drive.dt / 6371e3
    there = {"latitude": np.degrees(0.8 + north), "longitude": np.full(len(drive), 9.0)}
    level = {c: x for c, x in drive.channels.items() if c not in ("grade", "elevation")}
    flat = replace(drive.interface, grade=False)
    placed = replace(drive, channels=level | there, interface=flat)
    put(folder / "placed", placed)
    put(folder / "ahead", placed.piece(1000, len(drive)))
    back = {c: x[::-1].copy() for c, x in there.items()}
    put(folder / "back", replace(placed, channels=level | back))
    return folder


@pytest.fixture(scope="module")
def whole_and_later(bags: Path) -> Comparison:
    return compare([str(bags / "whole"), str(bags / "later")])


def test_a_later_start_is_found_and_nothing_is_left(whole_and_later: Comparison) -> None:
    _, later = whole_and_later.compared
    assert later.offset.found and later.offset.seconds == pytest.approx(40.0, abs=0.5)
    assert later.offset.correlation > 0.999
    assert later.difference is not None and later.difference.speed_rms_m_s < 0.02
    assert later.difference.shared_s == pytest.approx(380.0, abs=2.0)


def test_a_truck_file_runs_along_a_bag_without_fuel_rate_at_its_own_rate(
    bags: Path, drive: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    plain = {c: x for c, x in drive.channels.items() if c != "fuel_rate"}
    put(tmp_path / "plain", replace(drive, channels=plain, interface=replace(drive.interface, fuel=False)))
    Path("mine.yaml").write_text(yaml.safe_dump(TRUCK.specification.to_dict()))
    _, beside = compare(["plain", "truck:mine.yaml@plain"]).compared
    assert beside.difference is not None and beside.difference.speed_rms_m_s < 0.02
    TRUCK.with_dt(0.2).save(tmp_path / "slower")
    _, slower = compare(["plain", "slower@plain"]).compared
    assert slower.difference is not None and slower.difference.speed_rms_m_s < 0.3


def test_what_never_agrees_stays_where_it_began(bags: Path) -> None:
    _, other = compare([str(bags / "whole"), str(bags / "other")]).compared
    assert not other.offset.found and other.offset.seconds == 0.0 and other.offset.correlation < 0.8


def test_an_offset_that_is_given_is_taken(bags: Path) -> None:
    sides = [str(bags / "whole"), str(bags / "later")]
    _, later = compare(sides, given={"later": 30.0}).compared
    assert later.offset.seconds == 30.0 and not later.offset.found and later.offset.correlation < 0.99


@pytest.mark.parametrize("late_s", [0.0, 3.0, 6.0])
def test_how_late_two_follow_one_leader_is_left_to_compare(
    tmp_path: Path, drive: Recording, late_s: float
) -> None:
    speed, late = drive.channels["speed"], round(late_s / drive.dt)
    follows = np.concatenate([np.full(late, speed[0]), speed[: len(speed) - late]])
    led = drive.channels | {"leader_speed": speed, "gap": np.full(len(speed), 20.0)}
    put(tmp_path / "a", replace(drive, channels=led))
    put(tmp_path / "b", replace(drive, channels=led | {"speed": follows}))
    _, b = compare([str(tmp_path / "a"), str(tmp_path / "b")]).compared
    assert b.offset.by is By.LEADER and b.offset.seconds == 0.0
    assert b.difference is not None and (b.difference.speed_rms_m_s > 0.2) == (late_s > 0.0)


def test_a_leader_that_repeats_itself_is_met_where_both_began(tmp_path: Path, drive: Recording) -> None:
    swing = 18.0 + 2.0 * np.sin(2 * np.pi * drive.time / 30.0)
    for name in ("a", "b"):
        noisy = swing + np.random.default_rng(len(name)).normal(0.0, 0.02, len(swing))
        put(tmp_path / name, replace(drive, channels=drive.channels | {"leader_speed": noisy}))
    _, b = compare([str(tmp_path / "a"), str(tmp_path / "b")]).compared
    assert b.offset.by is By.LEADER and b.offset.seconds == 0.0


@pytest.mark.parametrize("begin_s", [0, 60, 130, 200, 280, 400])
def test_a_short_piece_of_another_drive_is_not_moved(
    bags: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], begin_s: int
) -> None:
    (other,) = read(bags / "other")
    short = put(tmp_path / "short", other.piece(10 * begin_s, 10 * begin_s + 120))
    told = RUN.invoke(
        cli.whole(), ["compare", str(bags / "whole"), str(short), "--out", str(tmp_path / "out")]
    )
    (side,) = json.loads((tmp_path / "out" / "compare.json").read_text())["sides"][1:]
    assert side["offset_s"] == 0.0 and side["offset_by"] == "nothing" and not side["offset_found"]
    assert "no offset of short was significant" in told.output
    assert "no offset was significant" in (tmp_path / "out" / "compare.html").read_text()


SAME_ROADS = [("placed", "ahead", "positions"), ("whole", "later", "slopes")]


@pytest.mark.parametrize(("a", "b", "by"), SAME_ROADS)
def test_a_shared_road_is_known_by_positions_or_by_slopes(bags: Path, a: str, b: str, by: str) -> None:
    first, other = compare([str(bags / a), str(bags / b)]).compared
    assert isinstance(other.road, Road) and other.road.by == by
    begun = first.side.distance[int(other.offset.seconds / other.side.step_s)]
    known = np.isfinite(other.road.place)
    np.testing.assert_allclose(other.road.place[known], (other.side.distance + begun)[known], atol=40.0)
    assert other.road.shared_m > 0.9 * other.side.distance[-1]


@pytest.mark.parametrize(
    ("a", "b", "why"),
    [
        ("placed", "back", "the other way"),
        ("whole", "other", "agree nowhere"),
        ("whole", "placed", "neither"),
    ],
)
def test_why_no_road_is_shared(bags: Path, a: str, b: str, why: str) -> None:
    _, other = compare([str(bags / a), str(bags / b)]).compared
    assert isinstance(other.road, str) and why in other.road


def test_a_simulator_drives_along_a_bag_on_its_clock(bags: Path, drive: Recording) -> None:
    bag = bags / "whole"
    _, simulated = compare([str(bag), f"truck:trucksim@{bag}"]).compared
    (r,) = read(bag)
    run = free_run(simulators.load("truck:trucksim"), r.u[None], r.w[None], r.y[None, 0]).y[0, :, 1]
    means = run[: len(run) // 5 * 5].reshape(-1, 5).mean(axis=1)
    np.testing.assert_allclose(simulated.side.columns["speed"][: len(means)], means, atol=1e-9)
    assert simulated.offset.seconds == 0.0 and simulated.side.simulated == "truck:trucksim"


def test_numbers_of_a_drive(whole_and_later: Comparison, drive: Recording) -> None:
    whole = whole_and_later.compared[0].statistics
    speed = drive.channels["speed"]
    assert whole.duration_s == pytest.approx(420.0) and whole.mean_speed_m_s == pytest.approx(
        speed.mean(), abs=0.01
    )
    assert whole.distance_m == pytest.approx(speed.sum() * drive.dt, rel=1e-3)
    litres = drive.channels["fuel_rate"].sum() * drive.dt / 1000.0
    assert whole.fuel_l_per_100_km == pytest.approx(1e5 * litres / whole.distance_m, rel=1e-3)
    assert whole.mean_gap_m is None and 0.0 < (whole.braking_share or 0.0) < 1.0


def test_a_hole_is_no_standstill(tmp_path: Path, drive: Recording) -> None:
    hole = drive.channels["speed"].copy()
    hole[1000:2000] = np.nan
    put(tmp_path / "a", drive)
    put(tmp_path / "b", replace(drive, channels=drive.channels | {"speed": hole}))
    _, b = compare([str(tmp_path / "a"), str(tmp_path / "b")]).compared
    assert b.statistics.duration_s == pytest.approx(320.0, abs=2.0)
    assert b.difference is not None and b.difference.speed_rms_m_s < 0.02


def test_the_page_has_the_numbers_of_the_file_and_fetches_nothing(
    whole_and_later: Comparison, tmp_path: Path
) -> None:
    write(whole_and_later, tmp_path)
    told = json.loads((tmp_path / "compare.json").read_text())
    text = (tmp_path / "compare.html").read_text()
    assert 'value="40"' in text and told["sides"][1]["offset_s"] == 40.0
    for side in told["sides"]:
        assert f">{side['statistics']['distance_m']:.4g}<" in text
        for name, value in (side["difference"] or {}).items():
            assert value is None or f'data-number="{name}">{value:.4g}<' in text
    assert "u[" not in re.sub("<script>.*</script>", "", text, flags=re.S)
    assert not re.search(r"(?:src|href)=|https?://|fetch\(|@import", text)


def test_speeds_are_shown_in_another_unit_and_stored_in_ours(
    bags: Path, whole_and_later: Comparison, tmp_path: Path
) -> None:
    bag = bags / "whole"
    given = ["compare", str(bag), str(bags / "other"), "--out", str(tmp_path / "out")]
    done = RUN.invoke(cli.whole(), [*given, "--units", "km/h"])
    assert done.exit_code == 0, done.output
    (side,) = json.loads((tmp_path / "out" / "compare.json").read_text())["sides"][1:]
    rms = side["difference"]["speed_rms_m_s"]
    text = (tmp_path / "out" / "compare.html").read_text()
    assert f"{3.6 * rms:.3g} km/h off" in done.output and f"{3.6 * rms:.2g} km/h off" in text
    assert f'data-number="speed_rms_m_s">{3.6 * rms:.4g}</td><td>km/h' in text and "speed, km/h" in text
    with pytest.raises(InputError, match="not in 'knots'"):
        page.page(whole_and_later, "knots")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["{0}/whole"], "two sides or more"),
        (["{0}/whole", "{0}/whole"], "is given twice"),
        (["{0}/whole", "{0}/none"], "does not exist"),
        (["{0}/whole", "truck:none@{0}/whole"], "none"),
        (["{0}/whole", "truck:trucksim@"], "is a simulator, which runs along a drive"),
        (["{0}/whole", "{0}/later", "--offset-s", "later"], "write SIDE=SECONDS"),
        (["{0}/whole", "{0}/later", "--offset-s", "later=nan"], "'later=nan' is not understood"),
        (["{0}/whole", "{0}/later", "--offset-s", "=12.5"], "'=12.5' is not understood"),
        (["{0}/whole", "{0}/later", "--offset-s", "x=1"], "no side x to move"),
    ],
)
def test_bad_input_is_one_line(
    bags: Path,
    tmp_path: Path,
    script: Callable[..., tuple[int, str, str]],
    arguments: list[str],
    says: str,
) -> None:
    given = [a.format(bags) for a in arguments]
    code, _, error = script("compare", *given, "--out", tmp_path / "out")
    assert code == 2 and says in error and error.count("\n") == 1
    assert not (tmp_path / "out").exists()


WATCH = """
const seen = {errors: []}, frame = document.querySelector("iframe");
frame.addEventListener("load", () => {
  const w = frame.contentWindow, d = frame.contentDocument;
  w.addEventListener("error", e => seen.errors.push(e.message));
  const key = (k, shiftKey) => d.querySelector("#panels figure").dispatchEvent(
    new w.KeyboardEvent("keydown", {key: k, shiftKey, bubbles: true, cancelable: true}));
  const described = () => d.getElementById("marked").textContent;
  const ink = k => d.querySelectorAll("canvas")[k].toDataURL().length;
  seen.panels = d.querySelectorAll("#panels canvas").length;
  key("ArrowRight"); seen.begun = described();
  key("ArrowRight"); seen.moved = described();
  key("ArrowRight", true); seen.wider = described();
  key("Escape"); seen.gone = described();
  const level = ink(1), offset = d.querySelector("#offsets input");
  const type = text => { offset.value = text; offset.dispatchEvent(new w.Event("input")); };
  const page = () => [d.title, ...["h1", ".how", "#apart"].map(s => d.querySelector(s).textContent)];
  seen.found = page();
  type("0"); seen.moved_by_hand = page(); seen.redrawn = ink(1) !== level;
  const drawn = ink(0); type("1e9"); seen.refused = page(); seen.kept = ink(0) === drawn;
  d.querySelector(".back").click(); seen.back = page(); seen.value = offset.value;
  const inPage = code => {
    const script = d.createElement("script");
    script.textContent = `window.answer = (() => { ${code} })()`;
    d.body.append(script);
    return w.answer;
  };
  seen.coarse = inPage('return coarse(0, "gear").length');
  seen.fine = inPage('state.window = [100, 110]; draw(); return line(0, "speed").ys.length');
  seen.cursor = inPage('state.cursor = 105; return pointed()');
  seen.fit = d.getElementById("key").children[1].textContent;
  inPage('state.mark = [101, 104]; draw()'); d.getElementById("keep").click();
  seen.without = d.querySelector("#kept pre").textContent;
  inPage('byId("add").value = "engine_speed"; byId("add").dispatchEvent(new Event("change"))');
  seen.added = d.querySelectorAll("#panels canvas").length;
  seen.against = d.getElementById("xy-says").textContent;
  inPage('whole(); draw()');
  seen.residual = d.querySelectorAll("#residual tr").length;
  type("0");
  const by = d.getElementById("by");
  by.value = "place"; by.dispatchEvent(new w.Event("change"));
  key("ArrowRight"); seen.along = described();
  const over = d.querySelector(".u-over"), box = over.getBoundingClientRect();
  const at = (type, x, y = 50) => over.dispatchEvent(
    new w.MouseEvent(type, {clientX: box.left + x, clientY: box.top + y, button: 0, bubbles: true}));
  at("mousedown", 100); at("mousemove", 200); at("mouseup", 300); seen.brushed = described();
  at("mousemove", 400);
  seen.lines = [...d.querySelectorAll("#panels .u-cursor-x")].map(x => x.style.transform);
  const pre = document.createElement("pre"); pre.id = "seen"; pre.textContent = JSON.stringify(seen);
  document.body.append(pre);
});
"""


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium here; install it to look at the page")
def test_it_is_brushed_moved_and_keyed_in_a_browser(whole_and_later: Comparison, tmp_path: Path) -> None:
    text = html.escape(page.page(whole_and_later), quote=True)
    file = tmp_path / "page.html"
    file.write_text(f'<iframe width="1200" height="1600" srcdoc="{text}"></iframe><script>{WATCH}</script>')
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--dump-dom",
        "--host-resolver-rules=MAP * ~NOTFOUND", f"--user-data-dir={tmp_path / 'profile'}",
        "--virtual-time-budget=5000", file.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    found = re.search(r'<pre id="seen">(.*?)</pre>', done.stdout, re.S)
    assert found, done.stderr[-500:]
    seen = json.loads(html.unescape(found[1]))
    assert seen["errors"] == [] and seen["panels"] == 5
    assert seen["coarse"] == 420 and 100 <= seen["fine"] <= 104  # means of a second; 10 Hz
    assert "At 105.00 s" in seen["cursor"] and "speed, m/s:" in seen["cursor"] and " | " in seen["cursor"]
    assert re.search(r"fit of the speed (9\d|100)\.\d %", seen["fit"])
    assert seen["without"] == "--without whole:101.0:104.0" and seen["added"] == 6
    assert "means of 1 s" in seen["against"] and seen["residual"] > 5
    spans = [
        tuple(map(float, re.findall(r"[\d.]+", seen[k])[:2])) for k in ("begun", "moved", "wider", "brushed")
    ]
    begun, moved, wider, brushed = spans
    assert moved[0] > begun[0] and moved[1] - moved[0] == pytest.approx(begun[1] - begun[0], abs=0.3)
    assert wider[0] == moved[0] and wider[1] > moved[1] and seen["gone"] == ""
    assert seen["redrawn"] and " m marked" in seen["along"] and " s marked" in seen["begun"]
    assert brushed[1] > brushed[0] and "later: mean speed" in seen["brushed"]
    assert set(seen["lines"]) == {"translate(400px, 0px)"}  # one cursor in all panels
    assert seen["back"] == seen["found"] and seen["value"] == "40" and seen["kept"]
    assert all(now != then for now, then in zip(seen["moved_by_hand"], seen["found"], strict=True))
    assert "not moved" in seen["refused"][2]


# Moments and places of two sides that belong together


def _north(east_m: float) -> Side:
    """A minute at 20 m/s over the equator along a meridian, this far east of the one at 9 degrees."""
    n = np.arange(600)
    speed = np.full(len(n), 20.0)
    east_m_per_degree, north_m_per_degree = metres_per_degree(0.0)
    columns = {
        "speed": speed,
        "latitude": (2.0 * n - 600.0) / north_m_per_degree,
        "longitude": np.full(len(n), 9.0 + east_m / east_m_per_degree),
    }
    return Side("side", 0.1, columns, {})


@pytest.mark.parametrize("east_m", [-29.9, 0.0, 29.9])
def test_places_within_30_m_are_on_one_road(east_m: float) -> None:
    found = road(_north(0.0), _north(east_m))
    assert isinstance(found, Road) and found.by == "positions"
    np.testing.assert_allclose(found.place, _north(0.0).distance, atol=2.0)
    assert found.shared_m == pytest.approx(599 * 2.0)


@pytest.mark.parametrize("east_m", [-30.1, 30.1])
def test_places_farther_apart_are_on_no_shared_road(east_m: float) -> None:
    assert road(_north(0.0), _north(east_m)) == "No shared road: less than 500 m by positions"


# What a drive was like in numbers


def test_time_gaps_are_gap_over_speed_where_the_truck_rolls_and_the_gap_is_known() -> None:
    """Time gaps of 4, 2 and 3 s; at 1 m/s the truck does not roll."""
    columns = {
        "speed": np.array([10.0, 10.0, 10.0, 10.0, 1.0]),
        "gap": np.array([40.0, 20.0, 30.0, np.nan, 0.5]),
    }
    found = statistics.of(Side("drive", 0.1, columns, {}))
    assert found.median_time_gap_s == 3.0 and found.least_time_gap_s == 2.0

"""Slopes of trucks on one road: merged they are nearer to the true slope, and reach other recordings."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from deeptruck_core.errors import InputError
from deeptruck_model import trucks
from deeptruck_model.cli.mismatch import road as road_command
from deeptruck_model.fleet import page
from deeptruck_model.fleet.compare import DONE, VERDICT, folder
from deeptruck_model.fleet.extract import INDEX
from deeptruck_model.fleet.pool import pool
from deeptruck_model.fleet.roads import INTERVAL, MERGED, ROADS, TABLE, merged, road_map, roads, said
from deeptruck_model.fleet.run import Fleet, Workers, compare, extract
from deeptruck_model.fleet.slopes import COLUMNS, NO_POSITIONS, ONCE, SLOPES, slopes, written
from deeptruck_model.fleet.storage import place
from deeptruck_model.mismatch.prepare.drives import prepare_drives
from deeptruck_model.mismatch.prepare.places import STEP_M
from deeptruck_model.mismatch.residual.gather import gather
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.slopes import CELL_DEG, SharedRoads, cells, with_road
from deeptruck_model.recordings import Recording, read, write_bag
from deeptruck_model.trucks import PhysicsTruck, driving_cycles

Array = NDArray[np.float64]

TRUCK = trucks.load("freightliner")  # has no grade sensor
SPREAD = {"mass": 0.05, "drag_area": 0.05, "rolling_resistance": 0.1}  # relative sd between trucks
LATITUDE, LONGITUDE = 48.0003, 11.0  # where the road begins, which goes east in the middle of its cells
DEGREE_M = np.radians(1.0) * 6371e3
EAST_M = DEGREE_M * np.cos(np.radians(LATITUDE))  # a degree of longitude
POSITION_M, SPEED_NOISE = 2.0, 0.003  # sd of a receiver, m, and of the speed, m/s
SPACING_M = driving_cycles.RoadSettings().spacing
SECONDS = 240.0


def sibling(seed: int) -> PhysicsTruck:
    """A truck as the simulator, up to what differs between trucks of a class."""
    rng, own = np.random.default_rng(seed), TRUCK.parameters()
    return TRUCK.with_parameters({p: own[p] * (1.0 + sd * rng.standard_normal()) for p, sd in SPREAD.items()})


def drive(truck: PhysicsTruck, seed: int, monkeypatch: pytest.MonkeyPatch, road: Array) -> Recording:
    """Along the road, with the positions of a receiver that has an error."""
    rng = np.random.default_rng(seed)
    with monkeypatch.context() as m:
        m.setattr(driving_cycles, "road_grade", lambda *_, **__: road)
        driven = driving_cycles.drive(truck, seconds=SECONDS, seed=seed, name=f"drive{seed}")
    way = np.cumsum(driven.channels["speed"]) * driven.dt
    east, north = way + POSITION_M * rng.standard_normal(len(way)), POSITION_M * rng.standard_normal(len(way))
    noisy = {"latitude": LATITUDE + north / DEGREE_M, "longitude": LONGITUDE + east / EAST_M}
    noisy["speed"] = driven.channels["speed"] + rng.normal(0.0, SPEED_NOISE, len(way))
    return replace(driven, channels=driven.channels | noisy)


def hills(seed: int) -> Array:
    return driving_cycles.road_grade(40.0 * SECONDS + 2000.0, seed=seed)


def true_slope(row: dict[str, object], road: Array) -> float:
    """Mean along the cell."""
    index, column, way = str(row["cell"]).split(":")
    assert way == "E"
    cos_latitude = np.cos(np.radians((int(index) + 0.5) * CELL_DEG))
    west, east = ((int(column) + k) * CELL_DEG / cos_latitude for k in (0, 1))
    metres = (np.linspace(max(west, LONGITUDE), east, 50) - LONGITUDE) * EAST_M
    return float(np.interp(metres / SPACING_M, np.arange(len(road)), road).mean())


def recovered(drives: list[Recording]) -> list[dict[str, Any]]:
    """Rows of slopes.csv."""
    p = prepare_drives(TRUCK, drives[:-1], drives[-1:], Rules())
    return slopes(gather(TRUCK, p.prepared, p.held_out), p.prepared)


Made = tuple[Array, dict[str, list[dict[str, Any]]], list[Recording]]


def made(seed: int, trucks_: int) -> Made:
    """A road, the slopes of trucks of three drives each on it, and the drives of the last."""
    road, found, drives = hills(seed), {}, []
    with pytest.MonkeyPatch.context() as m:
        for k in range(1000 * seed, 1000 * seed + 10 * trucks_, 10):
            drives = [drive(sibling(k), k + n, m, road) for n in range(3)]
            found[f"truck{k % 1000 // 10}"] = recovered(drives)
    return road, found, drives


@pytest.fixture(scope="module")
def fleet() -> Made:
    return made(5, 4)


@pytest.mark.long
def test_intervals_of_simulated_fleets_hold_the_true_slope() -> None:
    """The table of docs/fleet.md; -s prints it."""
    fleets = [made(seed, 6) for seed in range(100, 112)]
    for count in (2, 3, 6):
        off, half, one = [], [], []
        for road, found, _ in fleets:
            some = dict(list(found.items())[:count])
            rows = {row["cell"]: row for row in merged(some) if row["trucks"] == count}
            off += [row["slope"] - true_slope(row, road) for row in rows.values()]
            half += [row["high"] - row["slope"] for row in rows.values()]
            one += [
                float(r["slope"]) - true_slope(r, road) for t in some.values() for r in t if r["cell"] in rows
            ]
        held = float(np.mean(np.abs(off) <= half))
        rms = [100.0 * float(np.sqrt(np.mean(np.square(x)))) for x in (one, off)]
        print(f"{count} trucks, {len(off)} cells: one truck {rms[0]:.3f} %, merged {rms[1]:.3f} %,")
        print(
            f"  intervals of ±{100.0 * np.median(half):.3f} % (median) hold the truth in {100 * held:.0f} %"
        )
        assert rms[1] < rms[0] and held > INTERVAL - 0.07


def test_merged_slopes_are_nearer_to_the_true_ones_than_one_trucks(fleet) -> None:
    road, found, _ = fleet
    rows = [row for row in merged(found) if row["trucks"] == len(found)]
    assert len(rows) > 20
    off = {row["cell"]: row["slope"] - true_slope(row, road) for row in rows}
    one = [float(r["slope"]) - true_slope(r, road) for t in found.values() for r in t if r["cell"] in off]
    rms = [float(np.sqrt(np.mean(np.square(x)))) for x in (list(off.values()), one)]
    assert rms[0] < 0.8 * rms[1] and rms[1] < 0.005


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    """Trucks whose errors are as large as those of simulated ones: of the truck, and of each passage."""
    rng, of_truck, of_passage, held = np.random.default_rng(0), 1.5e-3, 5e-4, []
    for k in (2, 3, 6):
        inside = []
        for _ in range(600):
            own = rng.normal(0.02, of_truck, k)
            where = {"cell": "1:2:E", "latitude": 48.0, "longitude": 11.0, "heading": 90.0}
            found = {
                f"{t}": [
                    where | {"slope": x, "variance": of_passage**2}
                    for x in mean + rng.normal(0.0, of_passage, 3)
                ]
                for t, mean in enumerate(own)
            }
            (row,) = merged(found)
            inside.append(row["low"] <= 0.02 <= row["high"])
        held.append(float(np.mean(inside)))
    assert min(held) > INTERVAL - 0.04 and max(held) < INTERVAL + 0.06


def test_another_truck_gets_the_slope_of_its_recordings(fleet, tmp_path: Path, capsys, monkeypatch) -> None:
    road, found, drives = fleet
    others = {truck: rows for truck, rows in found.items() if truck != "truck3"}
    rows = merged(others)
    (tmp_path / "result").mkdir()
    table = tmp_path / "result" / TABLE
    table.write_bytes(written(tuple(rows[0]), rows))
    (made, *_), left_out = with_road(SharedRoads.read(table), drives)
    known = np.isfinite(made.channels["grade"])
    way = np.cumsum(made.channels["speed"]) * made.dt
    truth = np.interp(way / SPACING_M, np.arange(len(road)), road)
    assert not left_out and known.mean() > 0.8
    assert np.abs(made.channels["grade"] - truth)[known].mean() < 0.3 * np.abs(truth).mean()
    elsewhere = replace(
        drives[0], channels=drives[0].channels | {"latitude": drives[0].channels["latitude"] + 1}
    )
    with pytest.raises(InputError, match="positions on these roads"):
        with_road(SharedRoads.read(table), [elsewhere])
    write_bag(tmp_path / "bag", drives[:1], interface=TRUCK.interface)
    tables, of = [], SharedRoads.read
    monkeypatch.setattr(SharedRoads, "read", staticmethod(lambda path: tables.append(path) or of(path)))
    road_command(table, [tmp_path / "bag"], tmp_path / "out")
    assert tables == [table]  # read once: by the check, whose value is used
    (again,) = read(tmp_path / "out")
    assert "1 recording with a grade" in capsys.readouterr().out and again.interface.grade
    np.testing.assert_allclose(again.channels["grade"], made.channels["grade"])
    bad = tmp_path / "bad.csv"
    bad.write_text("cell,slope\n1:2,0.1\n")
    with pytest.raises(InputError) as refused:
        road_command(bad, [tmp_path / "none"], tmp_path / "out2", other=tmp_path / "result")
    assert "--other was removed" in str(refused.value)


@pytest.mark.parametrize(
    ("slope", "says"),
    [("5.0", "5, which no road has"), ("nan", "'nan', which is no number"), ("x", "'x', which is no number")],
)
def test_a_slope_that_no_road_has_is_refused(tmp_path: Path, slope: str, says: str) -> None:
    table = tmp_path / TABLE
    table.write_text(f"cell,slope\n1:1:N,0.01\n1:2:N,{slope}\n")
    with pytest.raises(
        InputError, match=f"^{re.escape(str(table))}, line 3: slope is {says}; give roads.csv"
    ):
        SharedRoads.read(table)


@pytest.mark.parametrize("heading", [45.0, 135.0, 225.0, 315.0])
def test_a_passage_of_a_diagonal_road_has_one_cell(heading: float) -> None:
    """10 km between two quarters of the compass, with an error of 3 degrees in each heading."""
    rng, along = np.random.default_rng(0), np.arange(0.0, 10e3, STEP_M)
    north, east = (along * f(np.radians(heading)) for f in (np.cos, np.sin))
    noisy = (heading + rng.normal(0.0, 3.0, len(along))) % 360.0
    steps = np.stack([LATITUDE + north / DEGREE_M, LONGITUDE + east / EAST_M, noisy], axis=1)
    found = set(cells(steps))
    assert len(found) == len({cell[:2] for cell in found}) > 100
    assert not found & set(cells(steps - [0.0, 0.0, 180.0]))


@pytest.mark.parametrize(("high_km", "wide_km"), [(4.9, 0.0), (0.0, 4.9)])
def test_the_map_says_how_wide_and_how_high_it_is(high_km: float, wide_km: float) -> None:
    rows = [
        {
            "latitude": LATITUDE + 1000.0 * high_km * k / DEGREE_M,
            "longitude": LONGITUDE + 1000.0 * wide_km * k / EAST_M,
            "heading": 0.0,
            "slope": 0.01,
        }
        for k in (0.0, 0.5, 1.0)
    ]
    assert [float(x) for x in road_map(rows)["km"]] == pytest.approx([wide_km + 0.1, high_km + 0.1], abs=0.06)


def test_trucks_that_share_no_slope_say_why(fleet) -> None:
    *_, drives = fleet
    blind = [replace(d, channels={n: x for n, x in d.channels.items() if n != "latitude"}) for d in drives]
    with pytest.raises(InputError, match=NO_POSITIONS):
        recovered(blind)
    away = [
        replace(d, channels=d.channels | {"latitude": d.channels["latitude"] + k})
        for k, d in enumerate(drives)
    ]
    with pytest.raises(InputError, match=ONCE):
        recovered(away)
    with_grade = driving_cycles.drive(trucks.load("trucksim"), seconds=60.0, seed=0)
    with pytest.raises(InputError, match="takes the recorded slope"):
        p = prepare_drives(trucks.load("trucksim"), [with_grade], [], Rules())
        slopes(gather(trucks.load("trucksim"), p.prepared, p.held_out), p.prepared)


@pytest.fixture
def result(fleet, tmp_path: Path) -> Path:
    """What compare leaves of four trucks, and of a fifth without positions."""
    target = place(str(tmp_path / "result"))
    for truck, rows in (*fleet[1].items(), ("blind", None)):
        receipt = {
            "truck": truck, "key": truck, "simulator": "truck:freightliner", "hours_fitted": 1.0,
            "hours_held_out": 1.0, "nats_fitted": {}, "nats_held_out": {}, "weeks": {},
        }  # fmt: skip
        if rows is not None:
            target.write(f"{folder(truck)}/{SLOPES}", written(COLUMNS, rows))
        receipt |= {"files": []} | ({"no_slopes": NO_POSITIONS} if rows is None else {"files": [SLOPES]})
        target.write_json(
            f"{folder(truck)}/{VERDICT}", {"verdict": "nothing_missing", "findings": [], "tree": []}
        )
        target.write_json(f"{folder(truck)}/{DONE}", receipt)
    total = {"files": 9, "bytes": 1, "hours": 9.0}
    target.write_json(INDEX, {"total": total, "failed": {}, "trucks": {}, "quarantined": {}})
    return tmp_path / "result"


def test_the_stage_is_done_once_and_counts_who_has_no_positions(result: Path) -> None:
    target = place(str(result))
    found = roads(target)
    assert found["left_out"] == {"blind": NO_POSITIONS} and found["trucks"] == 4 and found["km"] > 2.0
    before = {n: (result / n).stat().st_mtime_ns for n in (ROADS, TABLE)}
    content = (result / TABLE).read_bytes()
    assert roads(target) == found
    assert {n: (result / n).stat().st_mtime_ns for n in before} == before
    for lost in (ROADS, TABLE):  # the first where it was killed before it was written
        (result / lost).unlink()
        assert roads(target) == found and (result / TABLE).read_bytes() == content


def damaged(content: bytes, how: str) -> bytes:
    if how == "no text":
        return content + b"\xff"
    return content.replace(b",slope,", b",tilt,") if how == "no column" else content.rpartition(b",")[0]


@pytest.mark.parametrize("how", ["no text", "no column", "cut off"])
def test_a_damaged_table_is_refused_by_its_name(result: Path, how: str) -> None:
    target = place(str(result))
    pool(target, {}, 0.05)
    roads(target)
    target.write(TABLE, damaged(target.read(TABLE), how))
    with pytest.raises(InputError, match=f"{TABLE} is damaged"):
        page.show(target)
    (result / TABLE).unlink()
    path = f"{folder('truck1')}/{SLOPES}"
    target.write(path, damaged(target.read(path), how))
    with pytest.raises(InputError, match=f"{path} is damaged"):
        roads(target)


@pytest.mark.parametrize("value", ["steep", "", "nan", "1e999"])
def test_a_slope_that_is_no_number_is_named_by_its_line(result: Path, value: str) -> None:
    target = place(str(result))
    pool(target, {}, 0.05)
    roads(target)
    for table, columns, stage in (
        (TABLE, MERGED, lambda: page.show(target)),
        (f"{folder('truck1')}/{SLOPES}", COLUMNS, lambda: roads(target)),
    ):
        lines = target.read(table).decode().splitlines()
        cells = lines[2].split(",")
        cells[columns.index("slope")] = value
        target.write(table, "\n".join([*lines[:2], ",".join(cells), *lines[3:]]).encode())
        says = (
            f"^{re.escape(f'{result}/{table}')}, line 3: slope is '{value}', which is no number; restore it"
        )
        with pytest.raises(InputError, match=says):
            stage()
        (result / TABLE).unlink(missing_ok=True)


def test_the_page_has_a_map_of_them_or_says_why_not(result: Path) -> None:
    target = place(str(result))
    pool(target, {}, 0.05)
    found = roads(target)
    page.show(target)
    text = (result / page.PAGE).read_text()
    assert said(found) in text and "1 truck left out, each because no positions" in text
    drawn = re.findall(r'<path stroke="#\w+" d="([^"]+)"', text)
    assert sum(d.count("M") for d in drawn) == round(10 * found["km"]) and len(drawn) > 1
    width, height = map(float, re.search(r'viewBox="0 0 (\S+) (\S+)"', text).groups())
    for x, y in re.findall(r"M(\S+) (\S+)l", " ".join(drawn)):
        assert 0.0 <= float(x) <= width and 0.0 <= float(y) <= height
    for truck in ("truck1", "truck2", "truck3"):
        path = f"{folder(truck)}/{DONE}"
        target.write_json(
            path, target.read_json(path) | {"files": [], "no_slopes": NO_POSITIONS, "key": "new"}
        )
    roads(target)
    page.show(target)
    text = (result / page.PAGE).read_text()
    assert "No road is shared: 4 trucks left out, each because no positions" in text and "<svg" not in text


@pytest.mark.long
def test_from_bags_to_shared_roads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    road = hills(7)
    for truck, k in (("a", 0), ("b", 1), ("blind", 2)):
        for n, day in enumerate(("2026-03-02", "2026-03-09", "2026-03-16")):
            driven = drive(sibling(k), 10 * k + n, monkeypatch, road)
            if truck == "blind":
                kept = {c: x for c, x in driven.channels.items() if c not in ("latitude", "longitude")}
                driven = replace(driven, channels=kept)
            bag = tmp_path / f"bag{k}{n}"
            write_bag(bag, [driven], interface=TRUCK.interface)
            at = tmp_path / "drives" / truck / day
            at.mkdir(parents=True)
            next(bag.glob("*.mcap")).rename(at / "drive.mcap")
    source, out = place(str(tmp_path / "drives")), place(str(tmp_path / "out"))
    extract(Fleet.of(source, out, "{truck}/{date}/*.mcap", "truck:freightliner"), Workers())
    compare(out, Workers())
    found = roads(out)
    assert found["left_out"] == {"blind": NO_POSITIONS} and found["trucks"] == 2 and found["km"] > 1.0
    before = {p: p.stat().st_mtime_ns for p in (tmp_path / "out").rglob("*")}
    compare(out, Workers())
    assert roads(out) == found and {p: p.stat().st_mtime_ns for p in before} == before

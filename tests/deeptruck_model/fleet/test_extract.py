"""Each file is read once, whatever fails; a restart does what is missing; the result has equal bytes."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyarrow import fs

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model import trucks
from deeptruck_model.fleet import page, pool, roads
from deeptruck_model.fleet.compare import VERDICTS
from deeptruck_model.fleet.extract import INDEX, RECEIPTS, load
from deeptruck_model.fleet.run import Fleet, Workers, compare, extract
from deeptruck_model.fleet.statistics import LEVEL
from deeptruck_model.fleet.storage import Place, place
from deeptruck_model.recordings import read, write_bag
from deeptruck_model.trucks import driving_cycles

LAYOUT = "{truck}/{date}/*.mcap"
HERE = Workers()


def fleet(source: Path, out: Path, handler: fs.FileSystemHandler | None = None) -> Fleet:
    def at(path: Path) -> Place:
        return place(str(path)) if handler is None else Place(fs.PyFileSystem(handler), str(path), str(path))

    return Fleet.of(at(source), at(out), LAYOUT, "truck:trucksim")


@pytest.fixture(scope="module")
def undisturbed(drives, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("undisturbed") / "out"
    extract(fleet(drives, out), HERE)
    return out


def test_what_is_kept_is_what_is_read(drives, undisturbed):
    index = json.loads((undisturbed / INDEX).read_text())
    assert list(index["trucks"]) == ["a", "b"] and not index["quarantined"] and not index["failed"]
    messages = index["account"]["messages"]
    assert messages["read"] == messages["used"] + sum(messages["set_aside"].values()) > 1000
    (kept,) = load(place(str(undisturbed)), index["trucks"]["b"][0]["parquet"])
    (there,) = read(drives / "b" / "2026-03-02" / "drive.mcap")
    assert kept.name == "2026-03-02/drive" and kept.interface == there.interface
    assert (kept.dt, kept.start_s, kept.notes, kept.obeyed) == (
        there.dt, there.start_s, there.notes, there.obeyed,
    )  # fmt: skip
    assert kept.channels.keys() == there.channels.keys()
    for name, values in there.channels.items():
        np.testing.assert_array_equal(kept.channels[name], values)


def test_each_file_is_read_once_and_never_again(flaky, drives, tmp_path):
    handler = flaky()
    extract(fleet(drives, tmp_path / "out", handler), HERE)
    extract(fleet(drives, tmp_path / "out", handler), HERE)
    sources = {path: n for path, n in handler.opened.items() if path.endswith(".mcap")}
    assert len(sources) == 4 and set(sources.values()) == {1}


def test_storage_that_often_fails_changes_nothing(flaky, drives, undisturbed, content, tmp_path):
    """Every fourth call fails. What is given up is listed, and read when the command is given again."""
    handler = flaky(0.25, seed=1)
    for _ in range(5):
        try:
            index = extract(fleet(drives, tmp_path / "out", handler), HERE)
        except InputError:
            continue
        if not index["failed"]:
            break
    assert content(tmp_path / "out") == content(undisturbed)


@pytest.mark.parametrize("calls", [5, 11, 17, 23, 30])
def test_a_run_that_is_killed_goes_on(flaky, drives, undisturbed, content, tmp_path, calls):
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        extract(fleet(drives, out, flaky(calls=calls)), HERE)
    done = len(list((out / RECEIPTS).glob("*.json"))) if (out / RECEIPTS).exists() else 0
    handler = flaky()
    extract(fleet(drives, out, handler), HERE)
    assert sum(n for path, n in handler.opened.items() if path.endswith(".mcap")) == 4 - done
    assert {n: c for n, c in content(out).items() if "/." not in n} == content(undisturbed)


def test_bad_files_are_quarantined_with_the_reason(drives, tmp_path):
    source, out = tmp_path / "drives", tmp_path / "out"
    shutil.copytree(drives, source)
    whole = (source / "a" / "2026-03-09" / "drive.mcap").read_bytes()
    (source / "a" / "2026-03-16").mkdir()
    (source / "a" / "2026-03-16" / "drive.mcap").write_bytes(whole[: len(whole) // 2])
    (source / "b" / "2026-03-16").mkdir()
    (source / "b" / "2026-03-16" / "again.mcap").write_bytes(whole)
    drive = driving_cycles.drive(trucks.load("trucksim"), seconds=40, seed=9)
    other = replace(drive, interface=TruckInterface("other", engine_unit="percent"))
    write_bag(tmp_path / "bag", [other], interface=other.interface)
    (source / "c" / "2026-03-02").mkdir(parents=True)
    next((tmp_path / "bag").glob("*.mcap")).rename(source / "c" / "2026-03-02" / "drive.mcap")
    index = extract(fleet(source, out), HERE)
    why = index["quarantined"]
    assert set(why) == {
        "a/2026-03-16/drive.mcap", "b/2026-03-16/again.mcap", "c/2026-03-02/drive.mcap",
    }  # fmt: skip
    assert "repair" in why["a/2026-03-16/drive.mcap"] and "/tmp" not in why["a/2026-03-16/drive.mcap"]
    assert why["b/2026-03-16/again.mcap"] == "the same content as a/2026-03-09/drive.mcap"
    assert "engine_command in percent" in why["c/2026-03-02/drive.mcap"]
    assert index["total"]["files"] == 7 and set(index["trucks"]) == {"a", "b"}


def test_a_fleet_of_another_interface_is_refused_before_the_rest_is_read(flaky, drives, tmp_path):
    handler = flaky()
    given = fleet(drives, tmp_path / "out", handler)
    (reading,) = given.readings.values()
    taken = replace(reading.taken, interface=replace(reading.taken.interface, engine_unit="percent"))
    given = replace(given, readings={"all": replace(reading, taken=taken)})
    with pytest.raises(InputError, match="engine_command in N m"):
        extract(given, HERE)
    assert sum(n for path, n in handler.opened.items() if path.endswith(".mcap")) == 3


def test_a_file_that_kills_its_process_is_quarantined(drives, tmp_path):
    from deeptruck_model.fleet import extract as extracting

    jobs = fleet(drives, tmp_path / "out").jobs()
    extracting.lost(jobs[0], "a worker was killed 4 times")
    index = extract(fleet(drives, tmp_path / "out"), HERE)
    assert index["quarantined"] == {jobs[0].drive.file.path: "a worker was killed 4 times"}
    assert len(index["trucks"]["a"]) == 1


# A fleet on Ray, whose command is killed and given again, leaves the bytes of one in this process


COMMAND = [sys.executable, "-c", "from deeptruck_model.cli import main; main()", "fleet"]
PATIENCE_S = 120.0


@pytest.mark.long
@pytest.mark.timeout(900)
def test_killed_on_ray_and_given_again_it_has_the_bytes_of_this_process(drives, content, tmp_path):
    pytest.importorskip("ray")
    here, there = tmp_path / "here", tmp_path / "there"
    extract(Fleet.of(place(str(drives)), place(str(here)), LAYOUT, "truck:trucksim"), Workers())
    compare(place(str(here)), Workers())
    pool.pool(place(str(here)), {}, LEVEL)
    roads.roads(place(str(here)))
    page.show(place(str(here)))
    command = [
        *COMMAND, str(drives), "--layout", LAYOUT, "--simulator", "truck:trucksim", "--out", str(there),
        "--engine", "ray", "--workers", "2",
    ]  # fmt: skip
    with subprocess.Popen(command) as run:
        end = time.monotonic() + PATIENCE_S
        while not any(Path(there / RECEIPTS).glob("*.json")) and time.monotonic() < end:
            time.sleep(0.01)
        run.kill()
    assert not (there / INDEX).exists()
    for _ in range(3):  # Ray gives up where it has not started in 30 s, as on a busy machine
        if subprocess.run(command, check=False).returncode == 0:
            break
    assert content(there, VERDICTS)
    assert content(there) == content(here)

"""A small fleet, imported by real processes here and on Ray."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model.fleet.jobs import Job, jobs
from deeptruck_model.fleet.run import run

COLUMNS = """
time: {column: t, unit: s}
channels:
  speed: {column: v, unit: m/s}
  engine_command: {column: p, unit: percent}
"""
PATIENCE_S = 200.0
Script = Callable[..., tuple[int, str, str]]


def write(path: Path, seconds: int = 60) -> None:
    t = np.arange(0.0, seconds, 0.1)
    v, p = 12 + 4 * np.sin(t / 9), 40 + 25 * np.cos(t / 9)
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, np.c_[t, v, p], "%.3f", ",", header="t,v,p", comments="")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with logs of the trucks a and b, of which that of b cannot be read."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "columns.yaml").write_text(COLUMNS)
    write(tmp_path / "logs" / "a" / "d0.csv")
    (tmp_path / "logs" / "b").mkdir()
    (tmp_path / "logs" / "b" / "d0.csv").write_text("t,v,p\nno number,1,2\n")
    return tmp_path


WORDS = ("fleet", "import", "logs/a", "logs/b", "--columns", "columns.yaml", "--out", "drives")


def made(folder: Path) -> dict[str, int]:
    """When each bag was made."""
    return {
        p.parent.relative_to(folder).as_posix(): p.stat().st_mtime_ns for p in folder.rglob("metadata.yaml")
    }


def test_a_broken_truck_does_not_stop_the_others_and_the_same_command_goes_on(
    here: Path, script: Script
) -> None:
    code, says, errors = script(*WORDS, "--jobs", "2")
    assert code == 2 and "1 of 2" in says and "b/d0: " in errors
    first = made(here / "drives")
    assert list(first) == ["a/d0"]
    page = (here / "drives" / "fleet.html").read_text()
    assert page.index("b/d0") < page.index("a/d0"), "what failed comes first"

    write(here / "logs" / "b" / "d0.csv")
    assert script(*WORDS)[0] == 0
    assert made(here / "drives").keys() == {"a/d0", "b/d0"}
    assert made(here / "drives")["a/d0"] == first["a/d0"]


def test_a_result_of_other_words_is_replaced_with_overwrite_alone(here: Path, script: Script) -> None:
    words = [word for word in WORDS if word != "logs/b"]
    assert script(*words)[0] == 0
    (here / "columns.yaml").rename(here / "meaning.yaml")
    words[words.index("columns.yaml")] = "meaning.yaml"
    first = made(here / "drives")
    code, _, errors = script(*words)
    assert code == 2 and "a/d0 holds an imported bag already" in errors
    assert made(here / "drives") == first
    assert script(*words, "--overwrite")[0] == 0
    again = made(here / "drives")
    assert again != first


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("fleet extract logs/a --out out", "'fleet extract' is no command; write 'fleet import'"),
        ("fleet import --columns a.yaml logs/a --out out", "give the trucks first: 'fleet import drives/*/"),
        ("fleet import logs/a --colums columns.yaml --out out", "No such option: --colums"),
        ("fleet import logs/a --seeds 2 --out out", "--seeds is for 'fleet train'"),
        ("fleet import logs/a --out logs/a/out", "or inside it, which is read here"),
        ("fleet import logs/a/d0.csv --out out", "is a file; give each truck as a folder"),
        ("fleet train logs/a --out mine", "mine holds notes.txt but no .deeptruck.json"),
        ("fleet train logs/a --out out --ray 127.0.0.1:9", "no Ray cluster answers at 127.0.0.1:9"),
        ("fleet import logs/a --columns columns.yaml --out cut", "fleet.json is damaged"),
    ],
)
def test_what_is_refused(here: Path, script: Script, words: str, says: str) -> None:
    for name in ("mine", "cut"):
        (here / name).mkdir()
    (here / "mine" / "notes.txt").write_text("mine")
    (here / "cut" / ".deeptruck.json").write_text('{"what": "the results of a fleet", "at_work": true}')
    (here / "cut" / "fleet.json").write_text("{")
    code, _, errors = script(*words.split())
    assert code == 2 and says in " ".join(errors.split())
    assert not [path for path in here.glob("out/*") if path.name[0] != "."]


def processes(out: Path) -> Iterator[Path]:
    """Entries of /proc of the jobs that write `out`, or below it."""
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            words = (process / "cmdline").read_bytes().split(b"\0")
            if b"-c" in words and any(word.startswith(bytes(out)) for word in words):
                yield process


def killed(out: Path, parent: bool) -> threading.Thread:
    """A thread that kills the first process of the job that writes `out`, or with `parent` who started it."""

    def kill() -> None:
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            for process in processes(out):
                with suppress(OSError):
                    by = int((process / "stat").read_text().rpartition(")")[2].split()[1])
                    os.kill(by if parent else int(process.name), signal.SIGKILL)
                    return
            time.sleep(0.01)

    thread = threading.Thread(target=kill, daemon=True)
    thread.start()
    return thread


def plan(here: Path) -> list[Job]:
    write(here / "logs" / "b" / "d0.csv")
    return [
        Job(
            f"{t}/d0",
            ("import", str(here / f"logs/{t}/d0.csv"), "--columns", "columns.yaml"),
            here / f"drives/{t}/d0",
        )
        for t in "ab"
    ]


def test_a_killed_fleet_leaves_no_process_and_goes_on(here: Path) -> None:
    jobs = plan(here)
    main = "from deeptruck_model.cli import main; main()"
    fleet = subprocess.Popen([sys.executable, "-c", main, *WORDS, "--jobs", "2"])
    killer = killed(jobs[1].out, parent=True)
    killer.join()
    assert fleet.wait(PATIENCE_S) == -signal.SIGKILL
    end = time.monotonic() + PATIENCE_S
    while (left := list(processes(here / "drives"))) and time.monotonic() < end:
        time.sleep(0.05)
    assert not left
    assert not run(jobs, here / "drives")
    assert made(here / "drives").keys() == {"a/d0", "b/d0"}


@pytest.mark.long  # Ray takes half a minute and more to start
def test_ray_does_the_job_of_a_killed_worker_again(
    here: Path, script: Script, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Real Ray, whose worker is killed while its job runs; then a broken truck and resumption on it."""
    monkeypatch.setenv("RAY_raylet_start_wait_time_s", "200")  # a busy machine takes its time
    monkeypatch.setenv("RAY_agent_register_timeout_ms", "200000")
    jobs = plan(here)
    killer = killed(jobs[1].out, parent=True)
    assert not run(jobs, here / "drives", ray="local")
    killer.join()
    assert made(here / "drives").keys() == {"a/d0", "b/d0"}
    first = made(here / "drives")
    (here / "logs" / "c").mkdir()
    (here / "logs" / "c" / "d0.csv").write_text("no table")
    code, says, errors = script(*WORDS, "--ray", "local")
    assert code == 0 and "2 of 2" in says
    words = [*WORDS[:4], "logs/c", *WORDS[4:], "--ray", "local"]
    code, says, errors = script(*words)
    assert code == 2 and "2 of 3" in says and "c/d0: " in errors
    assert made(here / "drives") == first
    assert set(json.loads((here / "drives" / "fleet.json").read_text())) == {"a/d0", "b/d0", "c/d0"}


# Which command lines a fleet's folders give


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """Truck a with logs by day and a bag of two files, truck b with one log and a note."""
    for name in (
        "a/monday/d0.csv", "a/tuesday/d0.mf4.gz", "a/bag/bag_0.mcap", "a/bag/bag_1.mcap",
        "a/bag/metadata.yaml", "a/.half/d1.csv", "b/d0.log", "b/notes.docx",
    ):  # fmt: skip
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    return tmp_path


def words(found: list[Job], root: Path) -> dict[str, str]:
    assert all(job.out == root / "out" / job.name for job in found)
    return {job.name: " ".join(job.words).replace(f"{root}/", "") for job in found}


def test_import_has_a_job_for_each_log(logs: Path) -> None:
    found, others = jobs("import", [logs / "a", logs / "b"], logs / "out", ["--columns", "{truck}.yaml"])
    assert words(found, logs) == {
        "a/bag": "import a/bag --columns a.yaml",
        "a/monday/d0": "import a/monday/d0.csv --columns a.yaml",
        "a/tuesday/d0": "import a/tuesday/d0.mf4.gz --columns a.yaml",
        "b/d0": "import b/d0.log --columns b.yaml",
        "b/notes": "import b/notes.docx --columns b.yaml",
    }
    assert not others


def test_train_and_mismatch_have_one_for_each_truck(logs: Path) -> None:
    found, others = jobs("mismatch", [logs / "a"], logs / "out", ["--simulator", "sims/{truck}"])
    assert words(found, logs) == {"a": "mismatch --recordings=a/bag --simulator sims/a"}
    assert [path.name for path in others] == ["d0.csv", "d0.mf4.gz"]
    found, _ = jobs("train", [logs / "a"], logs / "out", ["--budget", "20"])
    assert words(found, logs) == {"a": "train a/bag --budget 20"}


def test_seeds_have_a_job_each(logs: Path) -> None:
    found, _ = jobs("train", [logs / "a"], logs / "out", [], seeds=2)
    assert words(found, logs) == {"a/seed-0": "train a/bag --seed 0", "a/seed-1": "train a/bag --seed 1"}


def test_a_truck_may_be_a_bag_and_one_without_recordings_is_left_to_its_command(logs: Path) -> None:
    (logs / "c").mkdir()
    found, _ = jobs("import", [logs / "a" / "bag", logs / "c"], logs / "out", [])
    assert words(found, logs) == {"bag": "import a/bag", "c": "import c"}


def test_trucks_of_one_name_are_named_with_the_folder_above(logs: Path) -> None:
    (logs / "old" / "b").mkdir(parents=True)
    found, _ = jobs("train", [logs / "b", logs / "old" / "b"], logs / "out", [])
    assert [job.name for job in found] == [f"{logs.name}/b", "old/b"]


def test_what_cannot_be_a_fleet_is_refused(logs: Path) -> None:
    with pytest.raises(InputError, match="none does not exist"):
        jobs("train", [logs / "none"], logs / "out", [])
    (logs / "b" / "d0.csv").touch()
    with pytest.raises(InputError, match=r"d0\.log and .*d0\.csv have one name; rename one"):
        jobs("import", [logs / "b"], logs / "out", [])

"""Which command lines a fleet's folders give."""

from __future__ import annotations

from pathlib import Path

import pytest

from deeptruck_core.errors import InputError
from deeptruck_model.fleet.jobs import Job, jobs


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

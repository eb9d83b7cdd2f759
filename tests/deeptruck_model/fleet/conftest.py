"""Drives of a small fleet, and a local folder as storage that fails at random."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyarrow import fs

from deeptruck_model import trucks
from deeptruck_model.fleet import storage
from deeptruck_model.fleet.compare import DONE
from deeptruck_model.fleet.extract import MEASURED, RECEIPTS
from deeptruck_model.recordings import write_bag
from deeptruck_model.trucks import driving_cycles


@pytest.fixture(scope="session")
def drives(tmp_path_factory) -> Path:
    """Two trucks with two drives of 40 s each, one file for each drive."""
    root = tmp_path_factory.mktemp("fleet")
    truck = trucks.load("trucksim")
    for number, (name, day) in enumerate((t, d) for t in ("a", "b") for d in ("2026-03-02", "2026-03-09")):
        drive = driving_cycles.drive(truck, seconds=40, seed=number)
        bag = root / "bags" / f"bag{number}"
        write_bag(bag, [drive], interface=drive.interface)
        place = root / "drives" / name / day / "drive.mcap"
        place.parent.mkdir(parents=True)
        next(bag.glob("*.mcap")).rename(place)
    return root / "drives"


@pytest.fixture(autouse=True)
def no_waiting(monkeypatch):
    monkeypatch.setattr(storage, "WAIT_S", 0.0)


class Flaky(fs.FileSystemHandler):
    """Fails in `share` of the calls, by `seed`; after `calls` of them it ends the run as a kill does.

    `opened` counts how often each file was opened to be read.
    """

    def __init__(self, share: float = 0.0, seed: int = 0, calls: float = float("inf")) -> None:
        self.local, self.share, self.calls = fs.LocalFileSystem(), share, calls
        self.rng = np.random.default_rng(seed)
        self.opened: Counter[str] = Counter()

    def _may_fail(self) -> None:
        self.calls -= 1
        if self.calls < 0:
            raise KeyboardInterrupt
        if self.rng.random() < self.share:
            raise OSError("the storage is busy")

    def __eq__(self, other: object) -> bool:
        return self is other

    def __hash__(self) -> int:
        return id(self)

    def __ne__(self, other: object) -> bool:
        return self is not other

    def get_type_name(self) -> str:
        return "flaky"

    def normalize_path(self, path: str) -> str:
        return path

    def get_file_info(self, paths: list[str]) -> Any:
        self._may_fail()
        return self.local.get_file_info(paths)

    def get_file_info_selector(self, selector: fs.FileSelector) -> Any:
        self._may_fail()
        return self.local.get_file_info(selector)

    def create_dir(self, path: str, recursive: bool) -> None:
        self.local.create_dir(path, recursive=recursive)

    def delete_dir(self, path: str) -> None:
        raise NotImplementedError

    def delete_dir_contents(self, path: str, missing_dir_ok: bool = False) -> None:
        raise NotImplementedError

    def delete_root_dir_contents(self) -> None:
        raise NotImplementedError

    def delete_file(self, path: str) -> None:
        self._may_fail()
        self.local.delete_file(path)

    def move(self, source: str, target: str) -> None:
        self._may_fail()
        self.local.move(source, target)

    def copy_file(self, source: str, target: str) -> None:
        raise NotImplementedError

    def open_input_stream(self, path: str) -> Any:
        self._may_fail()
        self.opened[path] += 1
        return self.local.open_input_stream(path)

    def open_input_file(self, path: str) -> Any:
        raise NotImplementedError

    def open_output_stream(self, path: str, metadata: Any) -> Any:
        self._may_fail()
        return self.local.open_output_stream(path)

    def open_append_stream(self, path: str, metadata: Any) -> Any:
        raise NotImplementedError


@pytest.fixture(scope="session")
def flaky() -> type[Flaky]:
    return Flaky


def _content(out: Path, below: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for path in sorted(p for p in (out / below).rglob("*") if p.is_file()):
        name = path.relative_to(out).as_posix()
        found[name] = path.read_bytes()
        if name.startswith(RECEIPTS) or path.name == DONE:
            found[name] = {n: v for n, v in json.loads(path.read_text()).items() if n not in MEASURED}
    return found


@pytest.fixture(scope="session")
def content() -> Callable[..., dict[str, Any]]:
    """All files below a folder by name; receipts without times."""
    return _content

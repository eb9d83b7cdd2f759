"""Fixtures of all tests: one thread for each library, since workers use all cores, and figures without a
screen.
"""

from __future__ import annotations

import fcntl
import gc
import os
import shutil
import subprocess
import sys
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import hypothesis
import pytest
from PIL import Image

for name, value in {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "Agg"}.items():
    os.environ.setdefault(name, value)
hypothesis.settings.register_profile("any machine", deadline=None)  # a busy one is no failure
hypothesis.settings.load_profile("any machine")

TRUCK = """
import numpy as np
from deeptruck_model import simulators
from deeptruck_model.trucks import driving_cycles
truck = simulators.load("truck:trucksim")
u, w, y = np.zeros((1, 5, 2)), np.zeros((1, 5, 1)), np.full((1, 5, 3), 10.0)
truck.step(truck.reset(y[:, 0]), u[:, 0], w[:, 0])
simulators.free_run(truck, u, w, y[:, 0])
driving_cycles.drive(truck, seconds=30.0, seed=0)
"""
NETWORK = """
import numpy as np
from deeptruck_model.deep import DeepTruck, Shape, TruckNetwork
from deeptruck_model.deep.kernels import loss
from deeptruck_model.deep.data import Scales
from deeptruck_core.signals import TruckInterface
network = TruckNetwork(Shape(2, 1, 3, 8, 8), Scales(*np.ones((2, 6), np.float32)), 0.1)
"""
RUN = """
truck = DeepTruck(network, TruckInterface("toy"))
u, w, y = np.zeros((1, 5, 2)), np.zeros((1, 5, 1)), np.full((1, 5, 3), 10.0)
truck.step(truck.reset(y[:, 0]), u[:, 0], w[:, 0])
truck.rollout(u, w, y[:, 0], None)
"""
LEARN = """
x, target = np.zeros((1, 3, 2, 3), np.float32), np.ones((1, 4, 2, 3), np.float32)
loss.gradient(network, x, target, np.ones(3, np.float32), "deployment")
"""


@pytest.hookimpl(optionalhook=True)  # tests of the core run without xdist
def pytest_xdist_auto_num_workers() -> int:
    """One worker more than cores, since tests of nodes and buses wait in real time."""
    return (os.cpu_count() or 1) + 1


def pytest_configure(config: pytest.Config) -> None:
    """Compile the code that many tests need once, before workers and nodes with deadlines wait for it: the
    truck always, the network if there are several workers."""
    if hasattr(config, "workerinput"):
        return
    shared = bool(config.getoption("numprocesses", None))
    sources = [TRUCK + NETWORK + RUN, NETWORK + LEARN] if shared else [TRUCK]
    running = [subprocess.Popen([sys.executable, "-c", source]) for source in sources]
    for process in running:
        if process.wait(timeout=300):
            raise pytest.UsageError("what the tests share does not compile; the lines above say why")


def pytest_collection_finish() -> None:
    """Exclude the objects that exist after collection from garbage collection: they live as long as the
    tests."""
    gc.freeze()


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Callable[[Path], object]], Path]:
    """once(name, make) -> a folder that `make` fills once for all workers; the first worker makes it, the
    others wait."""
    base = tmp_path_factory.getbasetemp()
    place = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    def _once(name: str, make: Callable[[Path], object]) -> Path:
        folder, done = place / f"once-{name}", place / f"once-{name}.done"
        with (place / f"once-{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not done.exists():
                make(folder)
                done.touch()
        return folder

    return _once


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write figures as one white pixel, for tests of numbers and files."""

    def savefig(self: object, to: Any, **options: object) -> None:
        Image.new("L", (1, 1), "white").save(to, "png")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", savefig)


@pytest.fixture
def shuttle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The example of an outside simulator, copied under a unique module name into the current directory."""
    file = tmp_path / f"shuttle_{uuid.uuid4().hex}.py"
    shutil.copy(Path(__file__).parents[1] / "examples" / "shuttle.py", file)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])  # as importing from there puts it first
    return file

"""The node graph drives a simulator that somebody else wrote, and its bag is that truck's recording."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_model import recordings, simulators


def test_the_graph_drives_it_as_it_drives_itself(
    start: Callable[..., Any], shuttle: Path, tmp_path: Path
) -> None:
    text = f"python:{shuttle.stem}:make"
    arguments = ("--lockstep", "--duration", 6, "--leader", "sine", "--road", "sine")
    run = start(
        "start_simulation.py", "--simulator", text, "--policy", "baseline:acc", *arguments, "--record", "bag"
    )
    code, _, errors = run.finish()
    assert (code, errors) == (0, "")
    (drive,) = recordings.read(tmp_path / "bag")
    assert drive.interface.name == "shuttle" and len(drive) == 61
    again = simulators.free_run(simulators.load(text), drive.u[None], drive.w[None], drive.y[None, 0])
    np.testing.assert_allclose(again.y[0, 1:, 1], drive.y[1:, 1], atol=1e-3)

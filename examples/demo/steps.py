"""What the demo does: commands a user could type, with what each needs and what it makes."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path

from deeptruck_core import files

ROOT = Path(__file__).parents[2]
DEMO = files.Result("a demo")


@dataclass(frozen=True)
class Settings:
    """How much of everything."""

    hours: float = 1.0
    """driven data the deep truck learns from, besides what the node graph records"""
    graph_s: float = 120.0
    """driven in the node graph, lock-step"""
    updates: int = 3000
    """of the deep truck"""
    iterations: int = 10
    """of the policy"""
    follow_s: float = 70.0
    """of following, in simulation and over CAN; the radar jumps at 63 s"""
    mismatch_s: float = 300.0
    """of each of the recordings that the mismatch tool gets"""

    @classmethod
    def quick(cls) -> Settings:
        """The least that runs; its figures mean nothing."""
        return cls(0.1, 20.0, 80, 4, 12.0, 60.0)


@dataclass(frozen=True)
class Step:
    """One command; it takes --overwrite, which replaces what it wrote itself and nothing else. Others make
    way for one that runs in `real_time`."""

    name: str
    title: str
    command: tuple[str, ...]
    needs: tuple[str, ...] = ()
    real_time: bool = False

    @property
    def typed(self) -> str:
        """The command as a user would type it here."""
        return " ".join([Path(self.command[0]).name, *map(_from_here, self.command[1:])])


def _from_here(word: str) -> str:
    """A word of a command without absolute paths, where they lie in this folder or near it."""
    word = word.replace(f"{Path.cwd()}/", "")
    return min(word, os.path.relpath(word), key=len) if Path(word).is_absolute() else word


def plan(out: Path, s: Settings) -> list[Step]:
    """The steps, those first for which others wait longest."""
    drives, graph, simulator, policy = (out / name for name in ("drives", "graph", "simulator", "policy"))
    other = drives / "other"
    runs = ("--runs", out / "runs")
    scene = (
        "--policy", policy, "--leader", "steps:speeds=20/23/18/20,every=15,acceleration=0.6",
        "--radar", "field", "--initial-speed", "20", "--duration", f"{s.follow_s:g}", *runs,
    )  # fmt: skip
    return [
        Step("drive", "drive the truck through the paper's driving cycle", _python(
            "examples/demo/drives.py", "--out", drives,
            "--hours", f"{s.hours:g}", "--mismatch-s", f"{s.mismatch_s:g}",
        )),
        Step("record", "the same truck in the node graph, recorded", _python(
            "ros2_ws/start_simulation.py", "--simulator", "truck:trucksim", "--policy", "baseline:acc",
            "--leader", f"recorded:path={drives / 'leader.csv'}", "--road", "random:grade=0.01,seed=1",
            "--initial-speed", "15", "--lockstep", "--duration", f"{s.graph_s:g}", "--record", graph, *runs,
        ), ("drive",)),
        Step("train", "learn the deep truck", _console(
            "deeptruck-model", "train", drives / "cycle", graph, "--out", simulator,
            "--budget", f"{s.updates}",
        ), ("record",)),
        Step("policy", "learn to follow on the deep truck", _console(
            "deeptruck-cacc", "train", "--trainer", "analytic", "--simulator", simulator, "--out", policy,
            "--seeds", "1", "--iterations", f"{s.iterations}",
        ), ("train",)),
        Step("can", "the same policy over CAN, real time", _python(
            "ros2_ws/start_vehicle.py", "--vehicle", "trucksim", "--emulator", "--engage",
            "--interface", "loopback", "--channel", "demo", *scene, "--record", out / "following" / "can",
        ), ("policy",), real_time=True),
        Step("mismatch", "what the simulator leaves out on another truck", _console(
            "deeptruck-model", "mismatch", "--simulator", "truck:trucksim",
            "--recordings", other / "a", other / "b", other / "c", "--held-out", other / "d",
            "--out", out / "mismatch",
        ), ("drive",)),
        Step("simulate", "follow in the node graph", _python(
            "ros2_ws/start_simulation.py", "--simulator", simulator, *scene, "--lockstep",
            "--record", out / "following" / "simulation",
        ), ("policy",)),
        Step("evaluate", "open-loop errors on a drive it has not seen", _console(
            "deeptruck-model", "evaluate", simulator, drives / "test", "--out", out / "open_loop",
        ), ("train",)),
        Step("coverage", "what the recordings hold", _console(
            "deeptruck-model", "coverage", drives / "cycle", graph, "--out", out / "coverage",
        ), ("record",)),
    ]  # fmt: skip


def _console(script: str, *words: str | Path) -> tuple[str, ...]:
    return (str(Path(sys.executable).with_name(script)), *map(str, words))


def _python(script: str, *words: str | Path) -> tuple[str, ...]:
    return (sys.executable, str(ROOT / script), *map(str, words))

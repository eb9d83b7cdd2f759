"""What the demo does: commands a user could type, with what each needs and what it makes."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from deeptruck_core.errors import InputError

ROOT = Path(__file__).parents[2]
REAL_TABLE = Path("vt_heavy_truck") / "veh002_all.csv"


@dataclass(frozen=True)
class Settings:
    """How much of everything."""

    hours: float = 1.0
    """driven data the deep truck learns from, besides what the node graph records"""
    graph_s: float = 120.0
    """driven in the node graph, lock-step"""
    updates: int = 3000
    """of the deep truck; 0 leaves the choice to the trainer"""
    iterations: int = 40
    """of the policy"""
    follow_s: float = 70.0
    """of following, in simulation and over CAN; the radar jumps at 63 s"""
    mismatch_s: float = 300.0
    """of each of the recordings that the mismatch tool gets"""
    real_updates: int = 2000
    """of the model of the real truck"""

    @classmethod
    def quick(cls) -> Settings:
        """The least that runs; its figures mean nothing."""
        return cls(0.1, 20.0, 80, 4, 12.0, 60.0, 80)


@dataclass(frozen=True)
class Step:
    """One command; it takes --overwrite, which replaces what it wrote itself and nothing else.

    `makes` is a path below the demo's folder. A step that is `resumable` takes --resume too, and goes on
    after a kill. Others make way for one that runs in `real_time`. What has `doubts` about its result is
    tried once more.
    """

    name: str
    title: str
    command: tuple[str, ...]
    needs: tuple[str, ...] = ()
    makes: str = ""
    resumable: bool = False
    real_time: bool = False
    doubts: Callable[[], Sequence[str]] | None = None

    @property
    def typed(self) -> str:
        """The command as a user would type it here."""
        return " ".join([Path(self.command[0]).name, *map(_from_here, self.command[1:])])


def _from_here(word: str) -> str:
    """A word of a command without absolute paths, where they lie in this folder or near it."""
    word = word.replace(f"{Path.cwd()}/", "")
    return min(word, os.path.relpath(word), key=len) if Path(word).is_absolute() else word


def real_data() -> Path | None:
    """The folder of real recordings: DEEPTRUCK_REAL_DATA, or ../shared/data; None if there is none."""
    given = os.environ.get("DEEPTRUCK_REAL_DATA")
    folder = Path(given) if given else ROOT.parent / "shared" / "data"
    return folder if (folder / REAL_TABLE).exists() else None


def plan(out: Path, settings: Settings, real: Path | None) -> list[Step]:
    """The steps, what others wait for longest first."""
    return [*_learn(out, settings), *_follow(out, settings), *_explain(out), *_real(out, settings, real)]


def chosen(steps: Sequence[Step], only: Sequence[str] | None) -> list[Step]:
    """The steps named in `only` and what they need; all for None. Raises InputError for an unknown name."""
    known = {step.name: step for step in steps}
    wanted = list(only or known)
    for name in wanted:
        if name not in known:
            raise InputError(f"there is no step '{name}'; known: {', '.join(known)}")
        wanted += [need for need in known[name].needs if need not in wanted]
    return [step for step in steps if step.name in wanted]


def _console(script: str, *words: str | Path) -> tuple[str, ...]:
    return (str(Path(sys.executable).with_name(script)), *map(str, words))


def _python(script: str, *words: str | Path) -> tuple[str, ...]:
    return (sys.executable, str(ROOT / script), *map(str, words))


def _learn(out: Path, s: Settings) -> Sequence[Step]:
    drives = out / "drives"
    driven = _python(
        "examples/demo/drives.py", "--out", drives,
        "--hours", f"{s.hours:g}", "--mismatch-s", f"{s.mismatch_s:g}",
    )  # fmt: skip
    graph = _python(
        "ros2_ws/start_simulation.py", "--simulator", "truck:trucksim", "--policy", "baseline:acc",
        "--leader", f"recorded:path={drives / 'leader.csv'}", "--road", "random:grade=0.015,seed=1",
        "--initial-speed", "15", "--lockstep", "--duration", f"{s.graph_s:g}",
        "--record", out / "graph", "--runs", out / "runs",
    )  # fmt: skip
    train = _console(
        "deeptruck-model", "train", drives / "cycle", out / "graph",
        "--out", out / "simulator", "--budget", f"{s.updates}",
    )  # fmt: skip
    evaluate = _console(
        "deeptruck-model", "evaluate", out / "simulator", drives / "test", "--out", out / "open_loop"
    )
    coverage = _console(
        "deeptruck-model", "coverage", drives / "cycle", out / "graph", "--out", out / "coverage"
    )
    return (
        Step("drive", "drive the truck through the paper's driving cycle", driven, (), "drives"),
        Step("record", "the same truck in the node graph, recorded", graph, ("drive",), "graph"),
        Step("train", "learn the deep truck", train, ("record",), "simulator", True),
        Step("evaluate", "open-loop errors on a drive it has not seen", evaluate, ("train",), "open_loop"),
        Step("coverage", "what the recordings hold", coverage, ("record",), "coverage"),
    )


def _follow(out: Path, s: Settings) -> Sequence[Step]:
    """The same policy behind the same leader, in simulation and over CAN."""
    policy = out / "policy"
    train = _console(
        "deeptruck-cacc", "train", "--trainer", "analytic", "--simulator", out / "simulator", "--out", policy,
        "--seeds", "1", "--iterations", f"{s.iterations}",
    )  # fmt: skip
    scene = (
        "--leader", "steps:speeds=20/23/18/20,every=15,acceleration=0.6", "--radar", "field",
        "--initial-speed", "20", "--duration", f"{s.follow_s:g}", "--runs", str(out / "runs"),
    )  # fmt: skip
    simulate = _python(
        "ros2_ws/start_simulation.py", "--simulator", out / "simulator", "--policy", policy, *scene,
        "--lockstep", "--record", out / "following" / "simulation",
    )  # fmt: skip
    vehicle = _python(
        "ros2_ws/start_vehicle.py", "--vehicle", "trucksim", "--emulator", "--engage",
        "--interface", "loopback", "--channel", "demo", "--policy", policy, *scene,
        "--record", out / "following" / "can",
    )  # fmt: skip
    return (
        Step("policy", "learn to follow on the deep truck", train, ("train",), "policy", True),
        Step(
            "can", "the same policy over CAN, real time", vehicle, ("policy",), "following/can",
            real_time=True, doubts=lambda: _losses(out / "following" / "can"),
        ),
        Step("simulate", "follow in the node graph", simulate, ("policy",), "following/simulation"),
    )  # fmt: skip


def _losses(bag: Path) -> Sequence[str]:
    from examples.demo import following

    return following.losses(bag)


def _explain(out: Path) -> Sequence[Step]:
    other = out / "drives" / "other"
    command = _console(
        "deeptruck-model", "mismatch", "--simulator", "truck:trucksim",
        "--recordings", other / "a", other / "b", other / "c", "--held-out", other / "d",
        "--out", out / "mismatch",
    )  # fmt: skip
    title = "what the simulator leaves out on another truck"
    return (Step("mismatch", title, command, ("drive",), "mismatch"),)


def _real(out: Path, s: Settings, real: Path | None) -> Sequence[Step]:
    """A drive of a real truck, where its table is at hand."""
    if real is None:
        return ()
    folder = out / "real"
    importing = _python("examples/demo/real.py", real / REAL_TABLE, "--out", folder / "drives")
    train = _console(
        "deeptruck-model", "train", folder / "drives" / "train", "--out", folder / "simulator",
        "--budget", f"{s.real_updates}",
    )  # fmt: skip
    evaluate = _console(
        "deeptruck-model", "evaluate", folder / "simulator", folder / "drives" / "test",
        "--out", folder / "open_loop", "--horizon", "60",
    )  # fmt: skip
    return (
        Step("import", "a real truck's table becomes a bag", importing, (), "real/drives"),
        Step(
            "real",
            "learn the real truck",
            train,
            ("import",),
            "real/simulator",
            True,
        ),
        Step(
            "check", "open-loop errors on the real truck's last drives", evaluate, ("real",),
            "real/open_loop",
        ),
    )  # fmt: skip

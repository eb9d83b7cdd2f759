"""Does a change of structure leave every result as it was? The same commands in two trees, compared.

python benchmarks/same_results.py OLD_TREE NEW_TREE [--keep FOLDER] [--only mismatch]

Each tree is a checkout of this project. Every run has a fixed seed. Weights, policies and metrics are
compared byte by byte, verdict.json by its numbers and names: sentences may change. Exit code 1 where any
differs.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PROSE = {"says", "caveats", "would_be_told_by", "record_next", "equation", "headline"}
TIMES = {"seconds", "cpu_s", "wall_s", "trained", "created", "date", "git", "commit", "out", "source", "path"}


@dataclass(frozen=True)
class Run:
    """One command, run in both trees; `result` is the file below its folder that is compared."""

    name: str
    command: Sequence[str]
    result: str


def runs(drives: Path, out: Path) -> list[Run]:
    """The dozen runs, in an order in which what one writes may be read by the next."""
    other = next(drives.glob("*/d")).parent  # of the truck that differs from the simulator
    sim, differing = str(out / "train-0"), [str(other / name) for name in "abcd"]
    model, cacc = "deeptruck_model.cli", "deeptruck_cacc.cli"
    physics = ["--simulator", "truck:trucksim"]

    def train(seed: int, *more: str) -> Run:
        command = [model, "train", str(drives / "cycle"), "--budget", "60", "--seed", str(seed), *more]
        return Run(f"train-{seed}", command, "model.safetensors")

    def policy(name: str, *more: str) -> Run:
        return Run(name, [cacc, "train", *more], "policy.safetensors")

    def mismatch(name: str, *more: str) -> Run:
        return Run(name, [model, "mismatch", *more], "verdict.json")

    return [
        train(0),
        train(1, "--mode", "paper"),
        train(2, "--kind", "grey"),
        Run("evaluate", [model, "evaluate", sim, str(drives / "test"), "--trials", "20"], "metrics.json"),
        Run("coverage", [model, "coverage", str(drives / "cycle")], "coverage.json"),
        policy("cacc-physics", *physics, "--seeds", "1", "--iterations", "6"),
        policy("cacc-deep", "--simulator", sim, "--seeds", "2", "--iterations", "4"),
        policy("cacc-trpo", *physics, "--trainer", "trpo", "--iterations", "2"),
        Run(
            "cacc-evaluate",
            [cacc, "evaluate", "baseline:cacc", *physics, "--rollouts", "10"],
            "metrics.json",
        ),
        mismatch("mismatch-demo", *physics, "--recordings", *differing[:3], "--held-out", differing[3]),
        mismatch("mismatch-alone", *physics, "--recordings", *differing[:2]),
        mismatch("mismatch-null", *physics, "--recordings", str(drives / "cycle"), str(drives / "test")),
        mismatch(
            "mismatch-other-truck", "--simulator", "truck:freightliner", "--recordings", str(drives / "cycle")
        ),
        mismatch(
            "mismatch-deep", "--simulator", sim, "--recordings", *differing[:2], "--held-out", differing[3]
        ),
    ]


def environment(tree: Path) -> dict[str, str]:
    """This Python, with the packages of a tree."""
    paths = (tree / "src", tree / "ros2_ws" / "src" / "deeptruck_nodes")
    return {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths))}


def drive(tree: Path, out: Path, hours: float, seconds: float) -> None:
    """The drives of the demo, shorter."""
    command = [sys.executable, "examples/demo/drives.py", "--out", str(out), "--hours", f"{hours:g}"]
    command += ["--mismatch-s", f"{seconds:g}"]
    subprocess.run(command, cwd=tree, env=environment(tree), check=True, stdout=subprocess.DEVNULL)


def do(tree: Path, run: Run, out: Path) -> str:
    """What a run gave, as a hash, or its last words where it failed."""
    module, *arguments = run.command
    code = f"import sys; sys.argv[0] = {module!r}; from {module} import main; main()"
    command = [sys.executable, "-c", code, *arguments, "--out", str(out / run.name)]
    if not (out / run.name / run.result).exists():  # kept from a call before
        done = subprocess.run(
            command, cwd=tree, env=environment(tree), capture_output=True, text=True, check=False
        )
        if done.returncode:
            return (done.stderr.strip().splitlines() or ["no word"])[-1]
    content = (out / run.name / run.result).read_bytes()
    if run.result.endswith(".json"):
        content = json.dumps(bare(json.loads(content)), sort_keys=True).encode()
    return hashlib.sha256(content).hexdigest()[:16]


def bare(content: Any) -> Any:
    """JSON data without sentences, times and places."""
    if isinstance(content, dict):
        return {k: bare(v) for k, v in content.items() if k not in PROSE | TIMES}
    return [bare(v) for v in content] if isinstance(content, list) else content


def main() -> None:
    """Run, compare, print a line each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("--keep", type=Path, help="folder in which results stay; runs there are not repeated")
    parser.add_argument("--only", default="", help="runs whose name contains this")
    parser.add_argument("--hours", type=float, default=0.3)
    parser.add_argument("--seconds", type=float, default=400.0)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        kept = (given.keep or Path(scratch)).absolute()
        drives = kept / "drives"
        if not drives.exists():
            drive(given.old.absolute(), drives, given.hours, given.seconds)
        different = 0
        for before, after in zip(runs(drives, kept / "old"), runs(drives, kept / "new"), strict=True):
            if given.only in before.name:
                old = do(given.old.absolute(), before, kept / "old")
                new = do(given.new.absolute(), after, kept / "new")
                different += old != new
                print(f"{'same' if old == new else 'DIFFERS':8} {before.name:22} {old} {new}", flush=True)
    sys.exit(1 if different else 0)


if __name__ == "__main__":
    main()

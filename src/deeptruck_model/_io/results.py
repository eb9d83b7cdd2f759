"""Result folders of `deeptruck-model`: the kind of each and the files that it may hold."""

from __future__ import annotations

from pathlib import Path

from deeptruck_model import files
from deeptruck_model.checks import MANIFEST, WEIGHTS
from deeptruck_model.errors import InputError
from deeptruck_model.files import LEDGER, Result

TRUCK_FILES = (
    MANIFEST, WEIGHTS, "MODEL_CARD.md", "metrics.json", "coverage.json", "driven.safetensors",
    "reference.safetensors",
    "resume.safetensors", "tensorboard/events.out.tfevents.*",
)  # fmt: skip
DEEP_TRUCK = Result("a deep truck", TRUCK_FILES, resumes_from=("resume.safetensors", MANIFEST))
CALIBRATED = Result("a calibrated deep truck", TRUCK_FILES)
PHYSICS_TRUCK = Result("a physics truck", (MANIFEST,))
SWEEP = Result(
    "a sweep",
    (
        "sweep.json",
        "sweep.md",
        *(f"*/seed-*/{name}" for name in (*TRUCK_FILES, LEDGER)),
    ),
)
EVALUATION = Result(
    "an evaluation",
    ("metrics.json", "error_statistics.png", "scenarios.png", "samples.png", "evaluation.html"),
)
COMPARISON = Result("a comparison", ("compare.html", "compare.json"))
COVERAGE = Result("a coverage", ("coverage.json", "coverage.png", "coverage.html"))
BAG_FILES = ("*_0.mcap", "metadata.yaml")
BAG = Result("an imported bag", BAG_FILES)
WRITTEN_BAG = Result("a written bag", BAG_FILES)  # by a program that calls `write_bag`
BAG_WITH_ROAD = Result("a bag with a recovered slope", BAG_FILES)

FOUND = Result(
    "a mismatch result",
    (
        "verdict.json",
        "profiles.csv",
        "report.html",
        "simulator/simulator.json",
        "simulator/base/simulator.json",
        "refitted/simulator.json",
        "refitted/base/simulator.json",
    ),
)


def apart(out: Path, *inputs: Path, elsewhere: str = files.ELSEWHERE) -> None:
    """Raises InputError if `out` is one of the inputs or lies inside one."""
    place = out.resolve()
    for given in inputs:
        if place == given.resolve() or given.resolve() in place.parents:
            raise InputError(f"{out} is {given} or inside it, which is read here; {elsewhere}")

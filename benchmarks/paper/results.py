"""The files that the experiments write."""

from __future__ import annotations

from deeptruck_model.files import Result

_JUDGED = ("metrics.json", "error_statistics.png", "samples.png", "scenarios.png")
EXPERIMENT = Result(
    "an experiment",
    (
        "README.md",
        *("sample_run.png", "minutes.png"),
        *(f"{folder}{name}" for folder in ("", "freightliner/", "volvo/") for name in _JUDGED),
    ),
)

PAPER_PAGE, PICTURES, WORK = "paper.md", "paper", "work"
MEASURED = "measured.json"  # beside the pictures: the figures of every seed
SUMMARY, PAPER_HALVES = "summary.md", ("modelling.md", "control.md")
_DEEPEST = 7  # levels below `work`, enough for the seeds and TensorBoard files of a training in it
BESIDE_PAPER = Result(
    "a page beside the paper",
    (PAPER_PAGE, f"{PICTURES}/*", *(f"{WORK}{'/*' * depth}" for depth in range(1, _DEEPEST + 1))),
)

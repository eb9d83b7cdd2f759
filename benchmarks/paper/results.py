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

"""What a simulator is, loading one, running one, and whether one keeps the protocol."""

from deeptruck_model.simulators.protocol import (
    MANIFEST,
    Array,
    MinimalSimulator,
    Run,
    Simulator,
    completed,
    forced_run,
    free_run,
    load,
    read_manifest,
)

__all__ = [
    "MANIFEST",
    "Array",
    "MinimalSimulator",
    "Run",
    "Simulator",
    "completed",
    "forced_run",
    "free_run",
    "load",
    "read_manifest",
]

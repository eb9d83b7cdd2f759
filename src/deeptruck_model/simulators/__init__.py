"""What a simulator is, loading one, running one, and whether one keeps the protocol."""

from deeptruck_core.arrays import Array
from deeptruck_model.manifest import MANIFEST
from deeptruck_model.manifest import manifest as read_manifest
from deeptruck_model.simulators.protocol import MinimalSimulator, Simulator, completed, load
from deeptruck_model.simulators.running import Run, forced_run, free_run, run

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
    "run",
]

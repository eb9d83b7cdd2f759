"""For all tests: one thread each, as two run side by side, and figures without a screen."""

from __future__ import annotations

import os
import subprocess
import sys

for name, value in {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "Agg"}.items():
    os.environ.setdefault(name, value)

COMPILE = """
import numpy as np
from deeptruck_model import simulators
truck = simulators.load("truck:trucksim")
u, w, y = np.zeros((1, 5, 2)), np.zeros((1, 5, 1)), np.full((1, 5, 3), 10.0)
truck.step(truck.reset(y[:, 0]), u[:, 0], w[:, 0])
simulators.free_run(truck, u, w, y[:, 0])
"""


def pytest_configure(config: object) -> None:
    """Compile the truck once, before workers and nodes with deadlines each wait for their own compilation."""
    if not hasattr(config, "workerinput"):
        subprocess.run([sys.executable, "-c", COMPILE], check=True, timeout=300)

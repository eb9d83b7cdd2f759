"""For all tests: one thread each, as two run side by side, and figures without a screen."""

from __future__ import annotations

import os

for name, value in {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "Agg"}.items():
    os.environ.setdefault(name, value)

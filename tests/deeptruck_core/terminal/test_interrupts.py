"""An interrupt may come at any moment, also while numba takes over arguments or gives back results."""

from __future__ import annotations

import subprocess
import sys

import pytest

from deeptruck_core.terminal.interrupts import may_raise

SCRIPT = """
import random, signal
import numpy as np
from deeptruck_core.imports.compiler import numba
from deeptruck_core.terminal.interrupts import may_raise

@numba.njit
def run(x):
    return x + 1.0, x * 2.0

held = 0
def handler(_, frame):
    global held
    if ALWAYS or may_raise(frame):
        raise KeyboardInterrupt
    held += 1
    signal.setitimer(signal.ITIMER_REAL, 1e-4)

x, draw = np.zeros((1, 300, 3)), random.Random(0)
run(x)
signal.signal(signal.SIGALRM, handler)
for _ in range(300):
    try:
        signal.setitimer(signal.ITIMER_REAL, draw.uniform(1e-5, 1e-3))
        while True:
            run(x)
    except KeyboardInterrupt:
        pass
print("held back" if held else "never inside")
"""


def _interrupted(always: bool) -> subprocess.CompletedProcess[str]:
    source = SCRIPT.replace("ALWAYS", str(always))
    return subprocess.run(
        [sys.executable, "-c", source], capture_output=True, text=True, timeout=200, check=False
    )


def test_compiled_code_survives_every_interrupt() -> None:
    run = _interrupted(always=False)
    assert (run.returncode, run.stdout) == (0, "held back\n"), run.stderr


@pytest.mark.parametrize(
    ("name", "may"),
    [("numba.core.serialize", False), ("importlib._bootstrap", False), ("numbas", True), ("__main__", True)],
)
def test_where_an_exception_may_be_raised(name: str, may: bool) -> None:
    space = {"__name__": name}
    exec("import sys\ndef here(): return sys._getframe()", space)
    assert may_raise(space["here"]()) is may  # type: ignore[operator]

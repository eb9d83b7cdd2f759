"""The cache of compiled code: quick for later processes, never stale, and not needed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from deeptruck_model.trucks import compiled

PARTS = "from small.compiled import part\n\n@part\ndef twice(x):\n    return {factor} * x\n"
LOOPS = """
from small.compiled import entry
from small.parts import twice

@entry
def run(x):
    return twice(x)
"""
PROBE = "from small.loops import run\nprint(run(21.0), sum(run.stats.cache_hits.values()))"
READ_ONLY = """
import numba.core.caching as caching
def refuse(self): raise OSError("read-only")
for locator in caching.CacheImpl._locator_classes: locator.ensure_cache_path = refuse
from small.loops import run
print(run(21.0), 0)
"""


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A package of one part and one loop, compiled as the truck is."""
    folder = tmp_path / "small"
    folder.mkdir()
    shutil.copy(compiled.__file__, folder / "compiled.py")
    (folder / "__init__.py").touch()
    (folder / "parts.py").write_text(PARTS.format(factor=2.0))
    (folder / "loops.py").write_text(LOOPS)
    return tmp_path


def run(folder: Path, code: str = PROBE) -> tuple[float, int]:
    # Python's own cache of bytecode tells sources apart by whole seconds: a part can change within one.
    own = {"NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    environment = {**os.environ, **own}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    value, hits = done.stdout.split()
    return float(value), int(hits)


def test_a_second_process_finds_the_compiled_loop_and_a_changed_part_is_compiled_again(small: Path) -> None:
    assert run(small) == (42.0, 0)
    assert run(small) == (42.0, 1)
    (small / "small" / "parts.py").write_text(PARTS.format(factor=3.0))
    assert run(small) == (63.0, 0)


def test_runs_without_a_writable_cache(small: Path) -> None:
    assert run(small, READ_ONLY)[0] == 42.0

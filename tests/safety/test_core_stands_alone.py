"""The core depends on nothing but its tables, and every line and branch of it is tested."""

from __future__ import annotations

import ast
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from truck_bridge import safety

FOLDER = Path(safety.__file__).parent
MAY_IMPORT = {"__future__", "collections", "collections.abc", "dataclasses", "enum", "math"}
HERE = Path(__file__).parent
RESULT = HERE.parents[1] / "docs" / "results" / "bridge_mutation.md"
TESTS = [
    "motion",
    "hearing",
    "demands",
    "limits",
    "frames",
    "engagement",
    "handing_back",
    "losing",
    "arming",
    "stopping",
    "who_ends_it",
]


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.stem)
def test_the_core_imports_only_itself_and_has_no_clock_or_files(path):
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        for name in names:
            assert name in MAY_IMPORT or name.startswith("truck_bridge.safety"), name
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            assert node.func.id not in {"open", "print", "input", "exec", "eval", "__import__"}


def test_the_core_is_a_few_hundred_lines():
    assert sum(len(path.read_text().splitlines()) for path in FOLDER.glob("*.py")) < 1200


@pytest.mark.long
def test_every_line_and_branch_of_the_core_is_tested(tmp_path):
    report = tmp_path / "coverage.json"
    names = (f"test_{name}.py" for name in TESTS)
    command = [sys.executable, "-m", "pytest", "-q", "-o", "addopts=", "--import-mode=importlib"]
    command += ["-p", "no:cacheprovider", "-p", "no:xdist", f"--cov={FOLDER}", "--cov-branch"]
    command += [f"--cov-report=json:{report}", *(str(HERE / name) for name in names)]
    run = _run(command, tmp_path)
    assert run.returncode == 0, run.stdout[-2000:]
    found = json.loads(report.read_text())
    missing = {
        name: (file["missing_lines"], file["missing_branches"])
        for name, file in found["files"].items()
        if file["missing_lines"] or file["missing_branches"]
    }
    assert len(found["files"]) == len(list(FOLDER.glob("*.py")))
    assert missing == {}


@pytest.mark.long
def test_a_sample_of_mutants_is_detected():
    run = _run([sys.executable, str(HERE / "mutate.py"), "--sample", "10"], HERE)
    assert run.returncode == 0, run.stdout + run.stderr[-2000:]
    assert "10 mutants, 10 detected" in run.stdout


def test_the_whole_mutation_run_was_of_this_core():
    """A core that was changed wants `python tests/safety/mutate.py` anew."""
    sources = b"".join(path.read_bytes() for path in sorted(FOLDER.glob("*.py")))
    assert hashlib.sha256(sources).hexdigest() in RESULT.read_text()


def _run(command, folder):
    """Without what would make a second pytest report into the first."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("COV_", "PYTEST_"))}
    environment["SAFETY_VEHICLES"] = "trucksim"  # one vehicle reaches every line
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=250, check=False
    )

"""A result of ours that lies in the folder where Python was started is not taken for a library."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

BESIDE = """
import sys
from importlib.machinery import ModuleSpec

class Folder:  # as Python finds it where the library is not installed
    def find_spec(self, name, path=None, target=None):
        if name == "coverage":
            found = ModuleSpec(name, None, is_package=True)
            found.submodule_search_locations.append("coverage")
            return found

sys.modules.pop("coverage", None)
sys.meta_path.insert(0, Folder())
"""
TRUCK = """
from deeptruck_model import trucks
print(trucks.load("trucksim").dt, "coverage" in sys.modules)
"""


def run(program: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", BESIDE + program]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, timeout=120)


def test_a_folder_named_coverage_does_not_stop_a_truck(tmp_path: Path) -> None:
    done = run(TRUCK, tmp_path)
    assert (done.returncode, done.stdout) == (0, "0.1 False\n"), done.stderr

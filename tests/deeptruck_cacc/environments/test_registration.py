"""gymnasium finds the environment once the package is imported."""

from __future__ import annotations

import subprocess
import sys


def test_importing_the_package_registers_without_loading_the_environment() -> None:
    script = (
        "import sys, gymnasium, deeptruck_cacc\n"
        "print('torch' in sys.modules, gymnasium.spec('deeptruck/Cacc-v0').entry_point)\n"
    )
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert said.split() == ["False", "deeptruck_cacc.environments.adapters:CaccGymEnv"]

"""gymnasium finds the environment by the entry point that the package declares."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

PYPROJECT = Path(__file__).parents[3] / "pyproject.toml"


def test_the_entry_point_registers_without_loading_the_environment() -> None:
    points = tomllib.loads(PYPROJECT.read_text())["project"]["entry-points"]["gymnasium.envs"]
    module, _, function = points["__root__"].partition(":")
    script = (
        f"import sys, gymnasium\nfrom {module} import {function}\n{function}(); {function}()\n"
        "print('torch' in sys.modules, gymnasium.spec('deeptruck/Cacc-v0').entry_point)\n"
    )
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert said.split() == ["False", "deeptruck_cacc.environments.adapters:CaccGymEnv"]

"""The set-up of `make`, with a pip that installs nothing."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MISSING = "WARNING: Location 'file:///packages/torch/' is ignored: it is neither a file nor a directory."
OTHER = "WARNING: Retrying after connection broken"
PYTHON = """#!/bin/sh
[ "$1" = -c ] && exit 0
mkdir -p "$3/bin"
printf '#!/bin/sh\\ncat {said} >&2\\nprintf "%%s " "$@" > {asked}\\nexit {code}\\n' > "$3/bin/pip"
chmod +x "$3/bin/pip"
"""


def setup(folder: Path, code: int, *said: str) -> subprocess.CompletedProcess[str]:
    (folder / "said").write_text("".join(f"{line}\n" for line in said))
    python = folder / "python"
    python.write_text(PYTHON.format(said=folder / "said", asked=folder / "asked", code=code))
    python.chmod(0o755)
    command = ["make", "-s", "setup", f"PYTHON={python}", f"VENV={folder / 'venv'}"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=60)


@pytest.mark.parametrize("code", [0, 1])
def test_only_what_does_not_matter_is_hidden(tmp_path: Path, code: int) -> None:
    done = setup(tmp_path, code, MISSING, OTHER, "ERROR: No matching distribution")
    assert (done.returncode == 0) == (code == 0)
    assert OTHER in done.stderr and "ERROR: No matching distribution" in done.stderr
    assert MISSING not in done.stderr
    assert (tmp_path / "venv" / ".installed").exists() == (code == 0)
    assert "-c constraints.txt -e .[ros,dev]" in (tmp_path / "asked").read_text()


def test_a_quiet_pip_is_no_failure(tmp_path: Path) -> None:
    assert setup(tmp_path, 0).returncode == 0

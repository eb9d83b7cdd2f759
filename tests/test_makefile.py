"""The set-up of `make`, with a pip that installs nothing."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MISSING = "WARNING: Location 'file:///packages/torch/' is ignored: it is neither a file nor a directory."
OTHER = "WARNING: Retrying after connection broken"
TOLD = """Collecting torch==2.4
  Downloading https://host/whl/torch-2.4-cp312-cp312-linux_x86_64.whl (797.1 MB)
Using cached numpy-2.1.0-cp312.whl (16.4 MB)
  Downloading idna-3.10-py3-none-any.whl (70 kB)
Installing collected packages: idna, numpy, torch
Successfully installed idna-3.10
"""
PYTHON = """#!/bin/sh
[ "$1" = -c ] && exit 0
mkdir -p "$3/bin"
printf '#!/bin/sh\\ncat {said} >&2; cat {told}\\nprintf "%%s " "$@" > {asked}\\nexit {code}\\n' > "$3/bin/pip"
chmod +x "$3/bin/pip"
"""


def setup(folder: Path, code: int, *said: str) -> subprocess.CompletedProcess[str]:
    (folder / "said").write_text("".join(f"{line}\n" for line in said))
    python = folder / "python"
    (folder / "told").write_text(TOLD)
    python.write_text(
        PYTHON.format(said=folder / "said", told=folder / "told", asked=folder / "asked", code=code)
    )
    python.chmod(0o755)
    command = ["make", "-s", "setup", f"PYTHON={python}", f"VENV={folder / 'venv'}"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=240)


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


def test_what_takes_long_is_told_while_it_does(tmp_path: Path) -> None:
    told = setup(tmp_path, 0).stdout.splitlines()
    assert told[0].startswith("setting up")
    assert told[1:3] == ["  torch, 797.1 MB", "  numpy, 16.4 MB"]
    assert "unpacking" in told[3] and len(told) == 4


def test_the_site_is_built_with_warnings_as_errors(tmp_path: Path) -> None:
    setup(tmp_path, 0)
    python = tmp_path / "venv" / "bin" / "python"
    python.write_text('#!/bin/sh\necho "$@"\n')
    python.chmod(0o755)
    command = ["make", "-s", "docs", f"VENV={tmp_path / 'venv'}"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=240)
    assert done.stdout.splitlines()[-1] == "-m sphinx -q -W --keep-going -b html docs build/docs"
    assert "-c constraints.txt -e .[docs]" in (tmp_path / "asked").read_text()

"""One run at a time in a folder, also where the other is another process."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from deeptruck_model import exclusive
from deeptruck_model.errors import InputError

HOLD = """
import sys, pathlib
from deeptruck_model import exclusive
with exclusive.writing(pathlib.Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_second_run_is_refused_until_the_first_ends(tmp_path: Path) -> None:
    exclusive.free(tmp_path / "nowhere")
    other = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert other.stdout is not None and other.stdout.readline() == "held\n"
        with pytest.raises(InputError, match="another run is writing"):
            exclusive.free(tmp_path)
    finally:
        other.kill()
        other.communicate()
    with exclusive.writing(tmp_path):
        pass

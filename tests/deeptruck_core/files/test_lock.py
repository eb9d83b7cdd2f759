"""A name is held for one run at a time, by a file that is this user's alone."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.files import lock


def test_a_name_is_reserved_once_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    out = tmp_path / "out"
    for _ in range(2):
        with lock.reserved(out):
            assert (tmp_path / f"deeptruck-{os.getuid()}").stat().st_mode & 0o777 == 0o700
            with pytest.raises(InputError, match="another run is to write"), lock.reserved(out):
                pass
    assert not out.exists()

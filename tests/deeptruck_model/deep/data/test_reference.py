"""What a deep truck keeps beside its weights comes back as it was."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_model.deep.data import reference
from deeptruck_model.errors import InputError


def test_recordings_come_back(drive, tmp_path):
    kept = drive(60)
    reference.save([kept], tmp_path)
    (again,) = reference.load(tmp_path)
    assert (again.name, again.dt, again.interface) == (kept.name, kept.dt, kept.interface)
    assert set(again.channels) == set(kept.channels)
    np.testing.assert_allclose(again.channels["speed"], kept.channels["speed"], atol=1e-4)


def test_no_more_than_an_hour_is_kept(drive, tmp_path, monkeypatch):
    monkeypatch.setattr(reference, "MOST_S", 30.0)
    reference.save([drive(20), drive(20), drive(20)], tmp_path)
    assert sum(len(r) * r.dt for r in reference.load(tmp_path)) == pytest.approx(30.0, abs=0.2)


def test_a_folder_without_any_has_none(tmp_path):
    assert reference.load(tmp_path) == ()


def test_a_damaged_file_is_one_line(tmp_path):
    (tmp_path / reference.FILE).write_bytes(b"half")
    with pytest.raises(InputError, match="damaged"):
        reference.load(tmp_path)

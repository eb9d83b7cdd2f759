"""Grade from elevation, and channels that are concealed: in the sealed file only."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from csv_tables import HILLY, hilly, write_csv

from deeptruck_model.errors import InputError
from deeptruck_model.recordings import import_table, importing, read


def test_grade_comes_from_elevation_where_it_is_not_given(tmp_path: Path) -> None:
    import_table(write_csv(tmp_path / "drive.csv", hilly()), HILLY, tmp_path / "bag")
    (recording,) = read(tmp_path / "bag")
    np.testing.assert_allclose(recording.channels["grade"], 0.02, atol=1e-9)
    assert recording.interface.grade
    assert any("grade derived from elevation" in note for note in recording.notes)


def test_what_is_concealed_is_only_in_the_sealed_file(tmp_path: Path) -> None:
    table = write_csv(tmp_path / "drive.csv", hilly())
    done = import_table(table, {**HILLY, "conceal": ["elevation"]}, tmp_path / "bag")
    (recording,) = read(tmp_path / "bag")
    assert set(recording.channels) == {"speed", "acceleration", "ambient_temperature"}
    assert not recording.interface.grade
    assert b"elevation" not in b"".join(p.read_bytes() for p in (tmp_path / "bag").iterdir())
    assert done.sealed == tmp_path / "bag.sealed.csv"
    assert done.sha256 == hashlib.sha256(done.sealed.read_bytes()).hexdigest()
    sealed = np.genfromtxt(done.sealed, delimiter=",", skip_header=1)
    np.testing.assert_allclose(sealed[:, 0], recording.time)
    np.testing.assert_allclose(sealed[:, 1], hilly()["h"])


def test_sealed_times_are_the_bags(tmp_path: Path) -> None:
    columns = hilly()
    columns["v"][300:] = 10.0
    table = write_csv(tmp_path / "drive.csv", columns)
    meaning = {**HILLY, "split_at": {"speed_step": 2.5}, "conceal": ["elevation"]}
    done = import_table(table, meaning, tmp_path / "bag")
    time = np.concatenate([r.time for r in read(tmp_path / "bag")])
    assert done.sealed is not None
    np.testing.assert_allclose(np.genfromtxt(done.sealed, delimiter=",", skip_header=1)[:, 0], time)


def test_a_failed_bag_takes_its_sealed_file_along(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise InputError("disk full")

    monkeypatch.setattr(importing, "write_bag", fails)
    table = write_csv(tmp_path / "drive.csv", hilly())
    with pytest.raises(InputError, match="disk full"):
        import_table(table, {**HILLY, "conceal": ["elevation"]}, tmp_path / "bag")
    assert [p.name for p in tmp_path.iterdir()] == ["drive.csv"]

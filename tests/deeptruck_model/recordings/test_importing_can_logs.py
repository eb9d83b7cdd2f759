"""CAN logs go to the installed importer and come back on one clock."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from csv_tables import DATA

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import import_table, importing, read

Importer = Callable[[Path, dict[str, Any]], Any]


def test_can_logs_go_to_the_installed_importer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Channels of a bus come at rates of their own and become one clock."""
    seen: list[Any] = []

    def importer(log: Path, columns: dict[str, Any]) -> Any:
        seen.append((log, columns))
        fast, slow = 100.0 + np.arange(500) / 50, 100.003 + np.arange(100) / 10
        channels = {"speed": (slow, slow - 100), "engine_torque": (fast, 10 * (fast - 100))}
        return channels, TruckInterface("csu", brake_unit=None, grade=False, fuel=False).to_dict()

    monkeypatch.setattr(importing, "_can_importer", lambda: importer)
    log = tmp_path / "normal.log"
    log.touch()
    import_table(log, {"vehicle": "any", "name": "csu"}, tmp_path / "bag")
    assert seen == [(log, {"vehicle": "any", "name": "csu"})]
    (recording,) = read(tmp_path / "bag")
    assert recording.dt == 0.1 and recording.interface.name == "csu"
    torque, speed = recording.channels["engine_torque"], recording.channels["speed"]
    valid = ~np.isnan(torque)
    assert valid.sum() >= 99
    np.testing.assert_allclose(torque[valid], 10 * speed[valid], atol=1e-9)


def test_an_importers_complaint_is_the_users_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def importer(log: Path, columns: dict[str, Any]) -> Any:
        raise ValueError("no vehicle speed")

    monkeypatch.setattr(importing, "_can_importer", lambda: importer)
    (tmp_path / "normal.log").touch()
    with pytest.raises(InputError, match="no vehicle speed"):
        import_table(tmp_path / "normal.log", {}, tmp_path / "bag")


def test_the_installed_importer_reads_a_real_bus(tmp_path: Path) -> None:
    log = DATA / "j1939_csu" / "normal.log"
    if not log.exists():
        pytest.skip(f"{log} is not here")
    import_table(log, {"name": "csu"}, tmp_path / "bag")
    (recording,) = read(tmp_path / "bag")
    assert recording.channels["speed"].min() > 6.3 and recording.channels["speed"].max() < 15.3
    assert {"engine_speed", "gear"} <= set(recording.channels)

"""FMUs of our own physics truck, as files."""

from __future__ import annotations

from pathlib import Path

import pytest

from deeptruck_model.fmu import export


@pytest.fixture(scope="session")
def own(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`truck:trucksim` as an FMU."""
    out = tmp_path_factory.mktemp("fmu") / "own.fmu"
    export.export("truck:trucksim", out)
    return out


@pytest.fixture(scope="session")
def heavy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same truck with a mass of 24 t in place of 20 t."""
    place = tmp_path_factory.mktemp("heavy")
    (place / "heavy.yaml").write_text("mass: 24000\n")
    export.export(f"truck:trucksim:{place / 'heavy.yaml'}", place / "heavy.fmu")
    return place / "heavy.fmu"

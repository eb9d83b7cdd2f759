"""Small maps of what engine and brake contribute inside a truck that cannot be read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_core.json_data import from_json, to_json
from deeptruck_model.mismatch.residual.components import Shares
from deeptruck_model.mismatch.residual.evidence import Evidence


@pytest.fixture
def shares(nothing_missing: Evidence) -> Shares:
    """A truck whose engine gives 2 m/s^2 at full command at low speed and half of it at 20 m/s."""
    e = nothing_missing
    slow = e.lag(e["engine_command"], 0.4)
    signals = e.signals | {"engine": slow * (2.0 - 0.05 * e["speed"]), "ratio": np.full(len(e), 8.0)}
    return Shares.of(replace(e, signals=signals))


def test_forces_are_read_from_speed_and_command(shares: Shares) -> None:
    now = shares.now(np.array([16.0, 20.0]), np.array([[0.5, 0.0], [0.5, 0.4]]))
    assert now["engine"] == pytest.approx([0.6, 0.5], rel=0.05)
    assert now["brake"] == pytest.approx([0.0, 0.4], rel=0.2)
    assert now["drag"] == pytest.approx([1e-4 * 256, 1e-4 * 400])
    assert now["rolling"] == pytest.approx([0.06, 0.06])
    assert now["engine_speed"] == pytest.approx([128.0, 160.0], rel=0.01)


def test_a_truck_without_brake_command_has_no_brake_share(shares: Shares) -> None:
    assert shares.now(np.array([16.0]), np.array([[0.5]]))["brake"] == pytest.approx([0.0])


def test_maps_are_plain_data(shares: Shares) -> None:
    assert from_json(Shares, to_json(shares)) == shares

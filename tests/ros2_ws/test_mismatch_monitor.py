"""The monitor on the wire: silent beside the truck it knows, a warning beside another."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model import simulators
from deeptruck_model.mismatch import adapt
from deeptruck_model.mismatch.mechanisms.families import NAMES
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.recordings import read
from deeptruck_nodes import run_checks

TRUCK = ("--simulator", "truck:trucksim", "--policy", "baseline:acc", "--lockstep", "--duration", 40)
LEADER = ("--leader", "sine:speed=18,amplitude=2,period=30", "--road", "sine:grade=0.01,length=900")


def heard(bag: Path, topic: str) -> list[Any]:
    """The messages of a topic as Foxglove reads them."""
    (file,) = bag.glob("*.mcap")
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [message for *_, message in reader.iter_decoded_messages(topics=[topic])]


@pytest.mark.parametrize("mass", [pytest.param(20000.0, marks=pytest.mark.long), 14000.0])
def test_beside_a_simulated_truck(start: Callable[..., Any], tmp_path: Path, mass: float) -> None:
    (tmp_path / "other.yaml").write_text(f"mass: {mass}\n")
    monitor = f"truck:trucksim:{tmp_path / 'other.yaml'}"
    run = start("start_simulation.py", *TRUCK, *LEADER, "--monitor", monitor, "--record", tmp_path / "bag")
    code, said, errors = run.finish()
    assert (code, errors) == (0, "")
    assert ("mismatch_monitor: " in said and "the truck is not as simulated" in said) == (mass != 20000.0)
    residuals = [m.accel.linear for m in heard(tmp_path / "bag", "/mismatch/residual")]
    assert len(residuals) > 380  # of 400 steps; some of the first may pass unheard
    smoothed = np.array([r.y for r in residuals])
    statuses = [s for m in heard(tmp_path / "bag", "/diagnostics") for s in m.status]
    levels = {s.level if isinstance(s.level, int) else s.level[0] for s in statuses if "mismatch" in s.name}
    if mass == 20000.0:
        # how much of the start was heard differs from run to run, so the first 20 s are not judged by size
        assert np.nanmax(np.abs(smoothed[200:])) < 0.01 and levels == {0}
    else:
        assert np.nanmax(np.abs(smoothed)) > 0.1 and levels == {0, 1}
        warnings = [s for s in statuses if "not as simulated" in s.message]
        values = {v.key: v.value for v in warnings[-1].values}
        assert float(values["end_s"]) > float(values["start_s"]) > 1.0 and float(values["mean_force_n"]) != 0


@pytest.mark.parametrize("options", [pytest.param((), marks=pytest.mark.long), ("--engage", "--no-load")])
def test_no_force_is_named_of_commands_that_drive_nothing(
    start: Callable[..., Any], tmp_path: Path, options: tuple[str, ...]
) -> None:
    """Nobody engages, or nothing is sent: the commands would drive the simulator, and the truck rolls out."""
    truck = ("--vehicle", "trucksim", "--emulator", "--policy", "baseline:acc", "--duration", 8, *options)
    (tmp_path / "other.yaml").write_text("mass: 9000.0\n")
    monitor = f"truck:trucksim:{tmp_path / 'other.yaml'}"
    run = start("start_vehicle.py", *truck, "--monitor", monitor, "--record", tmp_path / "bag")
    code, _, errors = run.finish()
    assert (code, errors) == (0, "")
    statuses = [s for m in heard(tmp_path / "bag", "/diagnostics") for s in m.status if "mismatch" in s.name]
    assert {s.message for s in statuses} == {"not engaged"}
    assert not any(v.key == "mean_force_n" for s in statuses for v in s.values)
    assert all(np.isnan(m.accel.linear.x) for m in heard(tmp_path / "bag", "/mismatch/residual"))
    (drive,) = read(tmp_path / "bag")
    assert drive.obeyed and drive.account is not None
    assert np.nanmax(np.abs(drive.channels["engine_command"])) == 0.0  # the driver's foot is on no pedal
    assert drive.account.channels["engine_command"].left_out > 100


@pytest.mark.parametrize(
    ("truck", "says"),
    [
        (TruckInterface("a", "percent"), "this truck has engine_command in percent, .* takes N m"),
        (TruckInterface("b", "N m", None), "this truck has no brake_command, which .* needs"),
        (TruckInterface("c", grade=False), "this truck has no grade, which .* needs"),
    ],
)
def test_a_simulator_of_another_kind_is_refused(truck: TruckInterface, says: str) -> None:
    with pytest.raises(InputError, match=says):
        run_checks.monitor_fits("truck:trucksim", truck)


DRIVE = ("--simulator", "truck:trucksim", "--policy", "baseline:acc", "--lockstep")
VARIED = (
    "--leader",
    "random:low=8,high=22,acceleration=1,seed=3",
    "--road",
    "random:grade=0.02,length=800,seed=2",
)


def named(messages: list[Any]) -> list[dict[str, float]]:
    """The scalars of each message."""
    return [dict(zip(m.name, m.position, strict=True)) for m in messages]


@pytest.mark.long
def test_what_is_missing_is_named_while_driving(start: Callable[..., Any], tmp_path: Path) -> None:
    """In lock-step, in which every answer is waited for: equal runs give equal bags."""
    (tmp_path / "other.yaml").write_text("mass: 14000.0\n")
    monitor = ("--monitor", f"truck:trucksim:{tmp_path / 'other.yaml'}", "--record", tmp_path / "bag")
    run = start("start_simulation.py", *DRIVE, *VARIED, "--duration", 165, *monitor)
    code, _, errors = run.finish(timeout=300)
    assert (code, errors) == (0, "")
    stamps = [m.header.stamp.sec for m in heard(tmp_path / "bag", "/mismatch/names")]
    assert stamps == [91, 121, 151]  # the first stamp of a lock-step run is 1 s
    last = named(heard(tmp_path / "bag", "/mismatch/names"))[-1]
    families = {family: [last[n] for n in own] for family, own in NAMES.items()}
    for family, own in families.items():  # several may act together, so that it is no sum
        assert max(own) - 1e-6 <= last[family] <= min(sum(own), 1.0) + 1e-6
    assert max(last["unknown"], last["nothing"]) <= 1.0 - Rules.named
    assert last["mass"] + last["payload_change"] > 0.5 and last["mass"] <= last["load"]
    shares = named(heard(tmp_path / "bag", "/mismatch/budget"))[-1]
    error, horizon = shares.pop("speed_rmse"), shares.pop("horizon_s")
    assert error > 0.3 and horizon >= 10.0 and sum(shares.values()) == pytest.approx(1.0)
    statuses = [s for m in heard(tmp_path / "bag", "/diagnostics") for s in m.status if "mismatch" in s.name]
    values = {v.key: v.value for v in statuses[-1].values}
    assert values["names"] and values["budget"] and float(values["names_at_s"]) == pytest.approx(151.0)


@pytest.mark.long
def test_the_simulator_is_adapted_to_this_drive(start: Callable[..., Any], tmp_path: Path) -> None:
    """More rolling resistance by 0.5 % of the weight: what is estimated is that of `adapt` on the recorded
    bag."""
    (tmp_path / "rough.yaml").write_text("rolling_resistance: 0.011\n")
    (tmp_path / "nodes.yaml").write_text(
        "mismatch_monitor: {ros__parameters: {adapt_s: 100.0, names_s: 0.0}}\n"
    )
    truck = (
        "--simulator",
        f"truck:trucksim:{tmp_path / 'rough.yaml'}",
        "--policy",
        "baseline:acc",
        "--lockstep",
    )
    options = ("--monitor", "truck:trucksim", "--parameters", tmp_path / "nodes.yaml", "--duration", 160)
    run = start("start_simulation.py", *truck, *VARIED, *options, "--record", tmp_path / "bag")
    code, said, errors = run.finish(timeout=300)
    assert (code, errors) == (0, "") and "this drive's own, from " in said
    trucksim = simulators.load("truck:trucksim")
    offline = adapt(trucksim, read(tmp_path / "bag", interface=trucksim.interface), 100.0)
    statuses = [s for m in heard(tmp_path / "bag", "/diagnostics") for s in m.status if "mismatch" in s.name]
    live = {v.key: v.value for v in statuses[-1].values}
    for name, quantity in offline.own.each.items():
        state, value, _ = live[f"own_{name}"].split()
        assert state == quantity.state and float(value) == pytest.approx(
            offline.own.used(name), rel=1e-3, abs=1e-4
        )  # four digits are said
    assert not heard(tmp_path / "bag", "/mismatch/names")
    smoothed = np.array([m.accel.linear.y for m in heard(tmp_path / "bag", "/mismatch/residual")])
    before, after = (float(np.nanmean(part)) for part in (smoothed[100:1000], smoothed[1200:]))
    assert before < -0.03 and abs(after) < 0.5 * abs(before)

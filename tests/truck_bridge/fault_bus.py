"""Lies and forged demands on the bus, drawn: what control does meanwhile, on the road.

`python tests/truck_bridge/fault_bus.py --runs 1000` runs in lock-step: a truck whose speed is held by what
the bridge reports, and a lie about the frames that the bridge hears (`fault_lies.py`), or a forged demand.
With `--processes 50` bridge and truck are processes in real time. Every run is drawn from its seed.

A run is broken where control is kept for more than 1 s on a speed that another signal contradicts beyond the
vehicle's own tolerances; where a scene that must end control does not; or where control ends without a lie.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import can
import numpy as np
from fault_lies import Lie
from fault_wire import Wire
from fault_world import NAMES, load

from truck_bridge.bridge import Bridge
from truck_bridge.emulator.ecus import EcuEmulator
from truck_bridge.j1939 import checksums
from truck_bridge.safety import Heard
from truck_bridge.vehicles import Vehicle

STEP, ENGAGED_AT, FAULT_AT, LENGTH = 0.01, 0.6, 1.6, 8.0
AGE_M_S = 0.5  # between a speed on the bus and the truck's own: 0.1 s at 5 m/s^2
KEPT_S = 1.0
GAIN = 8.0  # percent of torque per m/s of missing speed

SPEEDS, DRIVELINE = (
    ("speed", "second_speed"),
    ("engine_speed", "gear_ratio", "driveline", "shifting", "lockup"),
)
# kind, signals, sizes to draw from. Which of them must end control is what the page says, and `ENDS`.
Scene = tuple[str, tuple[str, ...], tuple[float, ...]]
NO_SIZE = (math.nan,)
LIES: dict[str, Scene] = {
    "nothing": ("", (), NO_SIZE),
    **{f"{name} {kind}": (kind, (name,), NO_SIZE) for name in (*SPEEDS, "engine_speed", "engine_percent",
        "gear_ratio", "driveline", "accelerator", "brake_pedal") for kind in
        ("freeze", "error", "absent", "silent", "double")},
    **{f"{name} second sender": ("second", (name,), (0x03, 0x0B, 0x0F, 0x21)) for name in (*SPEEDS,
        "engine_speed", "gear_ratio")},
    **{f"{name} at 0": ("value", (name,), (0.0,)) for name in (*SPEEDS, "engine_speed", "gear_ratio")},
    **{f"{name} beyond": ("beyond", (name,), NO_SIZE) for name in (*SPEEDS, "engine_speed", "gear_ratio")},
    **{f"{name} scaled": ("scale", (name,), (0.5, 0.7, 0.85, 1.19, 1.4)) for name in (*SPEEDS,
        "engine_speed", "gear_ratio")},
    **{f"{name} drifts": ("drift", (name,), (-2.0, -0.5, 0.5, 2.0)) for name in SPEEDS},
    "both speeds at 0": ("value", SPEEDS, (0.0,)),
    "both speeds held": ("hold", SPEEDS, NO_SIZE),
    "both speeds scaled": ("scale", SPEEDS, (0.7, 0.85, 1.19, 1.3)),
    "both speeds drift": ("drift", SPEEDS, (-1.0, -0.5, -0.3, 0.3, 1.0)),
    "all signals frozen": ("freeze", ("all",), NO_SIZE),
    "pitch beyond": ("beyond", ("pitch",), NO_SIZE),
    "pitch at 89.9": ("value", ("pitch",), (89.9,)),
}  # fmt: skip
EARLY = ("second sender", "our own address demands", "a stranger demands")  # half of them before engaging


Forger = Callable[[Vehicle, float], Iterator[tuple[int, bytes]]]  # the frames that leave now


@dataclass(frozen=True)
class Verdict:
    """One run. Times in s from the fault; speeds in m/s."""

    scene: str
    vehicle: str
    ended_s: float  # NaN where control was kept
    false_s: float  # longest that control was kept on a contradicted speed
    gained: float  # by the truck, until control ended or the run did
    braked: float  # hardest slowing meanwhile, m/s^2, negative
    broken: tuple[str, ...]
    reason: str = ""


class Drive:
    """A truck, its bridge and a controller that holds a speed by what the bridge reports."""

    def __init__(self, vehicle: Vehicle, rng: np.random.Generator, speed: float) -> None:
        self.vehicle, self.now = vehicle, 0.0
        self.ours, self.trucks = Wire(rng), Wire(rng)
        self.ours.peer, self.trucks.peer = self.trucks, self.ours
        self.bridge = Bridge(vehicle, self.ours)
        slope = float(rng.uniform(-0.01, 0.02)) if vehicle.interface["grade"] else 0.0
        self.truck = EcuEmulator(vehicle, self.trucks, speed=speed, grade=lambda distance: slope)
        self.wanted, self.signals = speed, {"speed": math.nan}
        newton_metres = vehicle.interface["engine_unit"] == "N m"
        self.percent = vehicle.reference_torque["engine"] / 100 if newton_metres else 1.0
        self.forged: Forger | None = None
        self.bridge.arm(0.0)

    def step(self) -> None:
        """10 ms."""
        self.now += STEP
        self.ours.now = self.trucks.now = self.now
        self.truck.step(self.now)
        for can_id, data in self.forged(self.vehicle, self.now) if self.forged else ():
            for side in (self.ours, self.trucks):
                side.inbox.append((self.now, _message(can_id, data)))
        if round(self.now / STEP) % 2 == 0:
            missing = self.wanted - self.signals["speed"]
            percent = 0.0 if math.isnan(missing) else min(max(25.0 + GAIN * missing, 0.0), 80.0)
            self.bridge.command(percent * self.percent, 0.0, self.now, engaged=self.bridge.engaged)
        self.signals = {"speed": math.nan} | self.bridge.poll(self.now)

    def contradicted(self, lied: frozenset[str]) -> bool:
        """Whether a signal that nobody lies about contradicts the core's speed beyond the tolerances."""
        line, true = self.vehicle.table.driveline, self.truck.speed
        away = abs(self.bridge.safety.hearing.value("speed") - true)
        assert line is not None
        coupled = self.truck.inside("shifting", 0.0) == 0 and self.truck.inside("clutch", 2.0) == 2.0
        if "lockup" in {s.name for heard in self.vehicle.table.heard for s in heard.signals}:
            coupled = coupled and self.bridge.safety.hearing.value("lockup") == 1
        most = max(true, self.bridge.safety.hearing.value("speed"))
        tolerance = line.tolerance * most + line.slack_m_s + AGE_M_S
        by_engine = coupled and not lied & set(DRIVELINE) and most > line.above_m_s and away > tolerance
        return by_engine or ("second_speed" not in lied and away > self.vehicle.table.speed_gap_m_s + AGE_M_S)


def _message(can_id: int, data: bytes) -> can.Message:
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=True)


def _demands(axis: str, source: str, demand: float, mode: int, on_s: float) -> Forger:
    """TSC1 by one of the truck's own addresses, for `on_s` at a time, with a pause of 0.3 s."""

    def frames(vehicle: Vehicle, now: float) -> Iterator[tuple[int, bytes]]:
        message = vehicle.transmitted.get(axis)
        if message is None or message.layout.name != "TSC1":
            return
        period = 0.01 if axis == "engine" else 0.05
        count = round(now / period)
        if abs(count * period - now) > STEP / 2 or now % (on_s + 0.3) > on_s:
            return
        address = {"ours": vehicle.address, "nobody": 0x77, **vehicle.addresses}[source]
        can_id = message.axis.can_id & ~0xFF | address
        values = {**message.active, message.demand: demand, "OverrideControlMode": mode}
        values["OverrideControlModePriority"] = 0
        yield can_id, checksums.sign(message.axis.check, can_id, message.layout.encode(values), count)

    return frames


FORGED: dict[str, Forger] = {
    "transmission demands 100 %": _demands("engine", "transmission", 100.0, 2, 2.7),
    "transmission retards 100 %": _demands("retarder", "transmission", -100.0, 2, 2.7),
    "our own address demands": _demands("engine", "ours", 60.0, 2, 9.0),
    "a stranger demands": _demands("engine", "nobody", 60.0, 2, 9.0),
}


def must_end(scene: str, vehicle: Vehicle) -> bool:
    """Whether the scene is one that must end control, or refuse it, whatever the truck does meanwhile.

    Not where a counter already refuses the second frame of an address, nor what an open converter explains.
    """
    if scene in FORGED:
        return True
    kind, signals, _ = LIES[scene]
    if kind == "double":
        return not any(heard.check != "none" for heard in _messages(vehicle, signals))
    if kind in ("error", "absent", "silent", "beyond", "second") or scene == "pitch at 89.9":
        return True
    if kind == "freeze":
        return bool({"engine_speed", "engine_percent", "all"} & set(signals))
    if kind == "value" and set(signals) <= set(SPEEDS):
        return True
    by_engine = signals == ("engine_speed",) or scene == "gear_ratio scaled"
    return kind in ("scale", "value") and by_engine and not _messages(vehicle, ("lockup",))


def scenes(vehicle: Vehicle) -> list[str]:
    """Those that the vehicle's bus can have."""
    known = {signal.name for heard in vehicle.table.heard for signal in heard.signals} | {"all"}
    forged = [name for name in FORGED if "retards" not in name or "retarder" in vehicle.transmitted]
    return [name for name, (_, signals, _) in LIES.items() if set(signals) <= known] + forged


def _messages(vehicle: Vehicle, signals: tuple[str, ...]) -> list[Heard]:
    """Those that carry one of these signals."""
    return [one for one in vehicle.table.heard if {signal.name for signal in one.signals} & set(signals)]


def senders(vehicle: Vehicle, signals: tuple[str, ...]) -> set[int]:
    """Addresses of the true senders of these signals."""
    return {one.key & 0xFF for one in _messages(vehicle, signals)}


def play(seed: int, scene: str | None = None) -> Verdict:
    """One run in lock-step."""
    rng = np.random.default_rng(seed)
    vehicle = load(NAMES[seed % len(NAMES)])
    scene = scene or str(rng.choice(scenes(vehicle)))
    drive = Drive(vehicle, rng, float(rng.uniform(10.0, 22.0)))
    drive.wanted += float(rng.uniform(-2.0, 4.0))
    kind, signals, sizes = LIES.get(scene, ("", (), NO_SIZE))
    size = float(
        rng.choice([size for size in sizes if kind != "second" or size not in senders(vehicle, signals)])
    )
    at = FAULT_AT + float(rng.uniform(0.0, 0.3))
    at = 0.3 if scene.endswith(EARLY) and rng.random() < 0.5 else at
    engaged, begun, ended = False, False, math.nan
    false_since, longest, start, braked = math.nan, 0.0, math.nan, 0.0
    lied: frozenset[str] = frozenset()
    while drive.now < at + LENGTH and math.isnan(ended):
        drive.step()
        if not begun and drive.now >= at:
            begun, start = True, drive.truck.speed
            drive.forged = FORGED.get(scene)
            if kind:
                drive.ours.lie = Lie(vehicle, kind, signals, size)
                lied = frozenset(drive.ours.lie.signals)
        if not engaged and drive.now >= ENGAGED_AT:
            why = drive.bridge.engage(drive.now, person=True, lead_vehicle=True)
            engaged = not why
            if why and drive.now > ENGAGED_AT + 0.4:
                break
        state = drive.bridge.safety.state.value
        if engaged and state != "engaged":
            ended = drive.now - at
        false = state == "engaged" and begun and drive.contradicted(lied)
        false_since = (drive.now if math.isnan(false_since) else false_since) if false else math.nan
        longest = max(longest, 0.0 if math.isnan(false_since) else drive.now - false_since)
        braked = min(braked, drive.truck.acceleration) if begun else 0.0
    reason = drive.bridge.safety.reason if engaged else f"refused: {', '.join(why)}"
    early = at < ENGAGED_AT
    broken = []
    if early and engaged:
        broken.append("engaged")
    if not early and not engaged:
        broken.append("did not engage")
    if not early and math.isnan(ended) and must_end(scene, vehicle):
        broken.append("control was kept")
    if scene == "nothing" and not math.isnan(ended):
        broken.append("control ended for nothing")
    if longest > KEPT_S:
        broken.append("control was kept on a false speed")
    for side in (drive.ours, drive.trucks):
        side.shutdown()
    gained = drive.truck.speed - start
    return Verdict(
        scene, vehicle.name, 0.0 if early else ended, longest, gained, braked, tuple(broken), reason
    )


def report(verdicts: list[Verdict]) -> Iterator[str]:
    """A table by scene."""
    yield f"{'scene':<28}{'runs':>5}{'ended':>6}{'p50':>9}{'max':>9}{'false':>9}{'gained':>14}  broken"
    for scene in (*LIES, *FORGED):
        mine = [v for v in verdicts if v.scene == scene]
        if not mine:
            continue
        ended = [v.ended_s for v in mine if not math.isnan(v.ended_s)]
        times = f"{np.median(ended):>7.2f} s{max(ended):>7.2f} s" if ended else f"{'-':>9}{'-':>9}"
        driven = [v for v in mine if not math.isnan(v.gained)]  # on processes the road is not seen
        gained = (
            f"{min(v.gained for v in driven):>+6.1f} {max(v.gained for v in driven):>+6.1f}"
            if driven
            else "-"
        )
        broken = sorted({b for v in mine for b in v.broken})
        false = f"{max(v.false_s for v in driven):>7.2f} s" if driven else f"{'-':>9}"
        yield f"{scene:<28}{len(mine):>5}{len(ended):>6}{times}{false}{gained:>14}  {broken or 'none'}"
    broken = sum(bool(v.broken) for v in verdicts)
    yield f"{len(verdicts)} runs, {broken} broken"


def main() -> int:
    """Run many and say what broke."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0, help="seed of the first run")
    parser.add_argument("--scene", choices=[*LIES, *FORGED], help="only this one")
    parser.add_argument("--processes", type=int, help="so many runs on processes instead, in real time")
    options = parser.parse_args()
    if options.processes is not None:
        from fault_bus_processes import play_processes

        verdicts = [play_processes(seed) for seed in range(options.first, options.first + options.processes)]
    else:
        seeds = range(options.first, options.first + options.runs)
        verdicts = [play(seed, options.scene) for seed in seeds]
    print("\n".join(report(verdicts)))
    for number, verdict in enumerate(verdicts, options.first):
        if verdict.broken:
            print(f"seed {number}: {verdict}")
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    return 1 if any(v.broken for v in verdicts) else 0


if __name__ == "__main__":
    sys.exit(main())

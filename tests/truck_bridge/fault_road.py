"""The whole chain on the road: drawn faults of radar, bus and other nodes, and what the truck does then.

`python tests/truck_bridge/fault_road.py --runs 1000` runs radar, controller, bridge and truck in lock-step
(`fault_chain.py`) through the table of scenes (`fault_table.py`). With `--processes 50` bridge and truck are
processes in real time, with what must end control. Every run is drawn from its seed.

A run is broken where the truck brakes beyond 1 m/s^2 and neither the leader nor the true gap is the cause,
until 3 s after control ended; where control is kept for more than 1 s on a speed that another signal
contradicts beyond the vehicle's own tolerances; where the truck hits the leader under control; where a scene
that must end control does not, or one that is to be bridged does; and where control ends without a fault.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from fault_chain import Chain
from fault_lies import Lie, RadarLie
from fault_table import (
    BUS,
    LASTS,
    MOMENTS,
    SCENES,
    UNSEEN,
    forger,
    must_bridge,
    must_end,
    possible,
    senders,
)
from fault_world import NAMES, load

from deeptruck_nodes.leaders import Steps

ENGAGED_AT, LENGTH, AFTER_S = 0.6, 12.0, 3.0
KEPT_S = 1.0
BRAKED = -1.0  # m/s^2 beyond the slope
MEAN_S = 0.3  # over which an acceleration counts
CAUSE_S = 4.0  # for which a leader that slowed down explains braking
EARLY = ("second", "ours", "nobody")  # half of them before engaging
GRAVITY = 9.81


@dataclass(frozen=True)
class Verdict:
    """One run. Times in s from the fault; speeds in m/s."""

    scene: str
    size: float
    lasts: float  # s
    vehicle: str
    leader: str
    ended_s: float  # NaN where control was kept
    false_s: float  # longest that control was kept on a contradicted speed
    gained: float  # by the truck, until control ended or the run did
    braked: float  # hardest mean acceleration without cause, m/s^2, negative
    broken: tuple[str, ...]
    unseen: tuple[str, ...] = ()  # what the truck did on a fault that no receiver can know
    reason: str = ""


def _leader(rng: np.random.Generator, at: float) -> tuple[str, Steps]:
    """Steady in most runs; else it slows down or speeds up at about the time of the fault."""
    speed, begins = float(rng.uniform(10.0, 22.0)), at + float(rng.uniform(0.0, 4.0))
    name = str(rng.choice(["steady", "steady", "steady", "brakes", "opens"]))
    change = {"steady": 0.0, "brakes": -6.0, "opens": 3.0}[name]
    pull = {"steady": 1.0, "brakes": 2.0, "opens": 0.6}[name]
    return name, Steps((speed, speed + change), begins, pull)


class Witness:
    """What the truck does on the road."""

    def __init__(self, chain: Chain) -> None:
        self._chain, self._speeds, self._leads = chain, deque[float](maxlen=31), deque[float](maxlen=31)
        self._caused_at, self.braked, self.least_gap, self.hit = -math.inf, 0.0, math.inf, False

    def look(self) -> None:
        """After a step."""
        chain = self._chain
        speed, leads, gap = chain.truck.speed, chain.lane.ahead[1], chain.lane.ahead[0]
        self._speeds.append(speed)
        self._leads.append(leads)
        shield = chain.guard.shield
        assert shield is not None
        promise = shield.promise
        true = (np.array([x]) for x in (speed, leads, 0.0))
        near = gap - float(promise.needed_gap(*true, promise.dt)[0]) < promise.ease_m
        if near or (self._leads[-1] - self._leads[0]) / MEAN_S < -0.2:
            self._caused_at = chain.now
        pull = (self._speeds[-1] - self._speeds[0]) / MEAN_S + GRAVITY * chain.truck.slope
        if len(self._speeds) == 31 and chain.now - self._caused_at > CAUSE_S:
            self.braked = min(self.braked, pull)
        self.least_gap = min(self.least_gap, gap)
        self.hit |= gap <= 0 and chain.state == "engaged"


def play(
    seed: int,
    scene: str | None = None,
    policy: str = "baseline:acc",
    length: float = LENGTH,
    machine: str | None = None,
    names: Sequence[str] = NAMES,
) -> Verdict:
    """One run in lock-step, of this scene, of those of a machine, or of all; on one of these vehicles."""
    rng = np.random.default_rng(seed)
    vehicle = load(names[seed % len(names)])
    drawn = [one for one in possible(vehicle) if machine in (None, SCENES[one].machine)]
    name = scene or str(rng.choice(drawn))
    machine, kind, signals, sizes = SCENES[name]
    taken = senders(vehicle, signals) if kind == "second" else set()
    size = float(rng.choice([one for one in sizes if one not in taken]))
    at = float(rng.uniform(*MOMENTS))
    for_good = machine in ("forger", "driver") or kind in EARLY
    lasts = math.inf if for_good else float(rng.choice(LASTS))
    early = (kind in EARLY or set(signals) & set(EARLY)) and rng.random() < 0.5
    leader, profile = _leader(rng, at)
    at = 0.3 if early else at
    chain = Chain(vehicle, rng, profile, policy)
    witness: Witness | None = None
    engaged, ended, lied, start = False, math.nan, frozenset[str](), math.nan
    false_since, longest, why = math.nan, 0.0, ("not asked",)
    while chain.now < at + length and not chain.now > at + ended + AFTER_S:
        chain.step()
        if witness is None and chain.now >= at:
            witness, start = Witness(chain), chain.truck.speed
            if machine in ("bus", "driver"):
                chain.ours.lie = Lie(vehicle, kind, signals, size)
                lied = frozenset(chain.ours.lie.signals)
            chain.lie = RadarLie(kind, signals, size) if machine == "radar" else None
            chain.forged = forger(SCENES[name]) if machine == "forger" else None
        if machine == "driver" and chain.now >= at + 0.5:
            chain.truck.driver.brake_pedal = size
        if chain.now >= at + lasts:
            chain.ours.lie = chain.lie = None
        if not engaged and chain.now >= ENGAGED_AT:
            why = chain.engage()
            engaged = not why
            if why and chain.now > ENGAGED_AT + 0.6:
                break
        holds = chain.state == "engaged"
        if engaged and not holds and math.isnan(ended):
            ended, gained, reason = chain.now - at, chain.truck.speed - start, chain.bridge.safety.reason
        false = holds and witness is not None and chain.contradicted(lied)
        false_since = (chain.now if math.isnan(false_since) else false_since) if false else math.nan
        longest = max(longest, 0.0 if math.isnan(false_since) else chain.now - false_since)
        if witness is not None and not early and machine != "driver":  # whose braking is the cause
            witness.look()
    chain.close()
    assert witness is not None
    if math.isnan(ended):
        gained, reason = chain.truck.speed - start, "" if engaged else f"refused: {', '.join(why)}"
    broken = []
    if early and engaged:
        broken.append("engaged")
    if not early and (not engaged or ended < 0):
        broken.append("did not engage")
    if not early and math.isnan(ended) and must_end(name, size, lasts, vehicle):
        broken.append("control was kept")
    if not math.isnan(ended) and must_bridge(name, lasts):
        broken.append("control ended")
    if longest > KEPT_S:
        broken.append("control was kept on a false speed")
    road = ["braked"] * (witness.braked < BRAKED) + ["hit"] * witness.hit
    if name not in UNSEEN:
        broken += [f"{what} without cause" for what in road]
        road = []
    ended = 0.0 if early else ended
    return Verdict(
        name,
        size,
        lasts,
        vehicle.name,
        leader,
        ended,
        longest,
        gained,
        witness.braked,
        tuple(broken),
        tuple(road),
        reason,
    )


def _times(verdicts: list[Verdict]) -> str:
    """Longest time to the end of control, s, and in how many runs it ended where not in all; '-' in none."""
    ended = [v.ended_s for v in verdicts if not math.isnan(v.ended_s)]
    share = "" if len(ended) == len(verdicts) else f" ({len(ended)}/{len(verdicts)})"
    return f"{max(ended):.2f}{share}" if ended else "-"


def report(verdicts: list[Verdict]) -> Iterator[str]:
    """A table of each signal of the bus by what becomes of it, and one of the other scenes."""
    by_scene = {name: [v for v in verdicts if v.scene == name] for name in SCENES}
    single = {n: s for n, s in SCENES.items() if s.machine == "bus" and n == f"{s.signals[0]} {s.kind}"}
    kinds = list(dict.fromkeys(scene.kind for scene in single.values()))
    yield "| longest time to the end, s | " + " | ".join(kinds) + " |"
    yield "|---" * (len(kinds) + 1) + "|"
    for signal in BUS:
        cells = (by_scene.get(f"{signal} {kind}", []) for kind in kinds)
        yield f"| {signal} | " + " | ".join(_times(cell) if cell else "" for cell in cells) + " |"
    yield ""
    heads = ("scene", "runs", "longest time to the end, s", "false speed, s", "gained, m/s", "braked, m/s²")
    yield f"| {' | '.join(heads)} | not prevented |"
    yield "|---" * 7 + "|"
    rows = {"a signal of the bus": [v for n in single for v in by_scene[n]]}
    rows |= {name: mine for name, mine in by_scene.items() if name not in single}
    for name, mine in rows.items():
        if mine:
            driven = [
                v for v in mine if not math.isnan(v.gained)
            ] or mine  # on processes the road is not seen
            road = f"{max(v.false_s for v in driven):.2f} | {min(v.gained for v in driven):+.1f} to "
            road += f"{max(v.gained for v in driven):+.1f} | {min(v.braked for v in driven):.1f}"
            unseen = [what for v in mine for what in v.unseen]
            said = ", ".join(f"{what} {unseen.count(what)}" for what in dict.fromkeys(unseen))
            yield f"| {name} | {len(mine)} | {_times(mine)} | {road} | {said} |"
    yield ""
    unseen = sum(bool(v.unseen) for v in verdicts)
    yield f"{len(verdicts)} runs, {sum(bool(v.broken) for v in verdicts)} broken, {unseen} not prevented"


def main() -> int:
    """Run many and say what broke."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0, help="seed of the first run")
    parser.add_argument("--scene", choices=list(SCENES), help="only this one")
    parser.add_argument("--machine", choices=["bus", "radar", "forger"], help="only scenes of its faults")
    parser.add_argument("--vehicle", action="append", help="vehicle file or name; else ours, by turns")
    parser.add_argument("--policy", default="baseline:acc")
    parser.add_argument("--seconds", type=float, default=LENGTH, help="of a run, from the fault on")
    parser.add_argument("--processes", type=int, help="so many runs on processes instead, in real time")
    options = parser.parse_args()
    seeds = range(options.first, options.first + (options.processes or options.runs))
    if options.processes is not None:
        from fault_road_processes import play_processes

        verdicts = [play_processes(seed) for seed in seeds]
    else:
        names = options.vehicle or NAMES
        chosen = options.scene, options.policy, options.seconds, options.machine, names
        verdicts = [play(seed, *chosen) for seed in seeds]
    print("\n".join(report(verdicts)))
    for number, verdict in zip(seeds, verdicts, strict=True):
        if verdict.broken:
            print(f"seed {number}: {verdict}")
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    return 1 if any(v.broken for v in verdicts) else 0


if __name__ == "__main__":
    sys.exit(main())

"""What is found in an outside truck, by what its interface tells and in which units.

python benchmarks/bench_interfaces.py [--work runs/interfaces] [--jobs 2]

The truck is written here against the `Simulator` protocol alone: six gears by speed, a torque curve, brakes
with a lag. Eight drives of 200 s have wheel-speed and accelerometer noise; two are held out. The simulator is
the same truck without the hidden effect. A case that is done is not run again.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any, cast

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.constants import GRAVITY
from deeptruck_model.mismatch import find_mismatch
from deeptruck_model.mismatch.correction.improvement import HORIZONS_S
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import TruckInterface
from deeptruck_model.simulators import Simulator

Array = NDArray[np.float64]

RESULTS = Path(__file__).parents[1] / "docs" / "results" / "interfaces.md"
RATIOS = np.array([60.0, 40.0, 27.0, 18.0, 12.0, 8.0])  # engine, rad/s, per m/s
SHIFT, MASS = 130.0, 18000.0  # rad/s at which a gear is best; kg
BODY = {
    "mass": MASS,
    "drag_area": 6.0,
    "rolling_resistance": 0.006,
    "torque_gain": 1.0,
    "brake_gain": 1.0,
}
ENGINE = {"N m": 1.0, "percent": 15.0}  # N m for one unit of the command
BRAKE = {"percent": 0.06, "m/s^2": 1.0, "bar": 0.7}  # m/s^2 for one unit
SECONDS, DRIVES = 200.0, 8
EFFECTS = {"torque_limit": "torque_limit", "brake_lag": "brake_lag", "brake_fade": "brake_fade", "none": ""}


@dataclass(frozen=True)
class State:
    """Of a batch: speed, brake force per mass, and what the hidden effect remembers."""

    speed: Array
    brake: Array
    memory: Array


@dataclass(frozen=True)
class Box:
    """A truck behind the protocol. `hidden` is what the simulator does not have; `tells` which parameters
    can be refitted, None for all."""

    interface: TruckInterface
    dt: float = 0.1
    hidden: str = "none"
    tells: tuple[str, ...] | None = None
    body: Mapping[str, float] = field(default_factory=lambda: dict(BODY))

    def reset(self, y0: Array) -> State:
        """At the response y0 (batch, 2)."""
        return State(y0[:, 1].copy(), np.zeros(len(y0)), np.zeros(len(y0)))

    def force(self, state: State, y: Array) -> State:
        """At a recorded response."""
        return replace(state, speed=np.where(np.isnan(y[:, 1]), state.speed, y[:, 1]))

    def inside(self, state: State) -> dict[str, Array]:
        """It states nothing of itself."""
        return {}

    def parameters(self) -> dict[str, float]:
        """What can be refitted."""
        return {n: x for n, x in self.body.items() if self.tells is None or n in self.tells}

    def with_parameters(self, values: Mapping[str, float]) -> Box:
        """A changed copy."""
        return replace(self, body={**self.body, **values})

    def step(self, state: State, u: Array, w: Array) -> tuple[State, Array]:
        """One step under u on the slope w, where there is one."""
        body, v = self.body, state.speed
        brake, memory = self._brake(state, u)
        drag = 0.6 * body["drag_area"] * v**2 / body["mass"] + GRAVITY * body["rolling_resistance"]
        slope = GRAVITY * w[:, 0] if self.interface.grade else 0.0
        pull = self._torque(u[:, 0], v) * RATIOS[gear(v)] / body["mass"]
        speed = np.maximum(v + (pull - brake - drag - slope) * self.dt, 0.0)
        return State(speed, brake, memory), np.stack([(speed - v) / self.dt, speed], axis=1)

    def _torque(self, command: Array, v: Array) -> Array:
        asked = command * ENGINE[self.interface.engine_unit]
        if self.hidden == "torque_limit":
            asked = np.minimum(asked, 700.0)
        full = 1500.0 * np.clip(1.0 - ((RATIOS[gear(v)] * v - 140.0) / 160.0) ** 2, 0.3, 1.0)
        return np.asarray(np.clip(asked, -200.0, full) * self.body["torque_gain"])

    def _brake(self, state: State, u: Array) -> tuple[Array, Array]:
        """Acceleration of the brakes; and the command that has arrived, or the heat of the drums."""
        if self.interface.brake_unit is None:
            return np.zeros(len(u)), state.memory
        asked, memory = u[:, 1], state.memory
        if self.hidden == "brake_lag":
            memory = asked = memory + (asked - memory) * (1.0 - np.exp(-self.dt / 0.7))
        asked = asked * BRAKE[self.interface.brake_unit] * self.body["brake_gain"] * MASS / self.body["mass"]
        if self.hidden == "brake_fade":
            memory = memory + self.dt * (state.brake * state.speed / 3.0 - 0.01 * memory)
            asked = asked * np.clip(1.0 - 0.01 * memory, 0.5, 1.0)
        return state.brake + (asked - state.brake) * (1.0 - np.exp(-self.dt / 0.25)), memory


def gear(v: Array) -> NDArray[np.intp]:
    """Index of the ratio whose engine speed is nearest to the best."""
    return np.argmin(np.abs(RATIOS[None] * np.maximum(v, 0.5)[:, None] - SHIFT), axis=1)


def drive(truck: Box, seed: int, channels: Sequence[str]) -> Recording:
    """A driver follows a speed that changes every 20 s, over hills where the slope is an input."""
    rng = np.random.default_rng(seed)
    n, interface = round(SECONDS / truck.dt), truck.interface
    time = np.arange(n) * truck.dt
    wanted = np.interp(time, np.arange(0, SECONDS + 20, 20), rng.uniform(4, 24, round(SECONDS / 20) + 1))
    waves = zip((0.02, 0.012, 0.006), (90, 40, 17), rng.uniform(0, 6, 3), strict=True)
    hills = sum((a * np.sin(2 * np.pi * time / s + p) for a, s, p in waves), start=np.zeros(n))
    grade = hills if interface.grade else np.zeros(n)
    state, rows, v, late, slow = truck.reset(np.array([[0.0, wanted[0]]])), [], wanted[0], 0.0, 0.0
    for k in range(n):
        slow = float(np.clip(slow + 0.02 * (wanted[k] - v) * truck.dt, -0.5, 0.5))
        asked = 0.35 * (wanted[k] - v) + slow + GRAVITY * grade[k] + 0.1
        torque = float(np.clip(asked * MASS / RATIOS[gear(np.array([v]))[0]], 0.0, 1500.0))
        u = [torque / ENGINE[interface.engine_unit]]
        if interface.brake_unit:
            u.append(float(np.clip(-asked - 0.15, 0.0, 4.0)) / BRAKE[interface.brake_unit])
        rows.append((*(*u, 0.0)[:2], late, v))
        state, y = truck.step(state, np.array([u]), grade[k : k + 1, None])
        late, v = float(y[0, 0]), float(y[0, 1])
    return recorded(np.array(rows), grade, truck, f"drive{seed}", rng, channels)


def recorded(
    rows: Array, grade: Array, truck: Box, name: str, rng: np.random.Generator, channels: Sequence[str]
) -> Recording:
    """What a logger keeps of it, with the noise of its sensors."""
    n, v, interface = len(rows), rows[:, 3], truck.interface
    out: dict[str, Array] = {
        "engine_command": rows[:, 0],
        "speed": v + rng.normal(0.0, 0.01, n),
        "gear": gear(v).astype(np.float64) + 1.0,
        "engine_speed": RATIOS[gear(v)] * v + rng.normal(0.0, 0.3, n),
        "acceleration": rows[:, 2] + rng.normal(0.0, 0.03, n),
    }
    if "acceleration" not in channels:  # as a reader makes it
        out["acceleration"] = np.diff(out["speed"], prepend=np.nan) / truck.dt
    out = {c: x for c, x in out.items() if c in ("engine_command", "speed", "acceleration", *channels)}
    out |= {"brake_command": rows[:, 1]} if interface.brake_unit else {}
    out |= {"grade": grade + rng.normal(0.0, 0.0005, n)} if interface.grade else {}
    return Recording(name, truck.dt, out, interface)


def interface(engine: str = "percent", brake: str | None = "percent", grade: bool = True) -> TruckInterface:
    """Of the truck, in these units."""
    return TruckInterface("box", engine_unit=engine, brake_unit=brake, grade=grade, fuel=False)


USUAL = ("gear", "acceleration")
INTERFACES: dict[str, tuple[Box, tuple[str, ...]]] = {
    "engine and brake in percent": (Box(interface()), USUAL),
    "engine in N m, brake in bar": (Box(interface("N m", "bar")), USUAL),
    "brake in m/s²": (Box(interface(brake="m/s^2")), USUAL),
    "no brake recorded": (Box(interface(brake=None)), USUAL),
    "no slope": (Box(interface(grade=False)), USUAL),
    "engine speed recorded": (Box(interface()), (*USUAL, "engine_speed")),
    "speed and commands alone": (Box(interface()), ()),
    "50 ms steps": (Box(interface(), dt=0.05), USUAL),
    "only the mass can be refitted": (Box(interface(), tells=("mass",)), USUAL),
    "no parameter can be refitted": (Box(interface(), tells=()), USUAL),
}


@dataclass(frozen=True)
class Found:
    """What was told of one case: first name, names beside it, and held-out errors, m/s."""

    interface: str
    hidden: str
    first: str
    beside: list[str]
    before: float
    parameters_only: float
    after: float
    validated: bool


def case(name: str, hidden: str, work: Path) -> Found:
    """The case, kept in `work`."""
    kept = work / f"{list(INTERFACES).index(name)}-{hidden}.json"
    if not kept.exists():
        kept.write_text(json.dumps(asdict(found(name, hidden))))
    data: dict[str, Any] = json.loads(kept.read_text())
    return Found(**data)


def found(name: str, hidden: str) -> Found:
    """One run of the tool."""
    simulator, channels = INTERFACES[name]
    drives = [drive(replace(simulator, hidden=hidden), 100 + k, channels) for k in range(DRIVES)]
    result = find_mismatch(cast(Simulator, simulator), drives[:-2], drives[-2:]).result
    first, errors = (result.findings[:1] or [None])[0], result.fit.errors if result.fit else None
    before, alone, after = (
        (errors.before.speed, errors.parameters_only.speed, errors.after.speed) if errors else (0.0,) * 3
    )
    return Found(
        name,
        hidden,
        first.effect if first else "",
        list(first.cannot_be_told_from) if first else [],
        float(before),
        float(alone),
        float(after),
        bool(result.fit and result.fit.validated),
    )


def page(cases: Sequence[Found]) -> list[str]:
    """The table, a row a case."""
    missing = [c for c in cases if EFFECTS[c.hidden]]
    first = sum(c.first == EFFECTS[c.hidden] for c in missing)
    group = sum(EFFECTS[c.hidden] in (c.first, *c.beside) for c in missing)
    silent = [not c.first for c in cases if not EFFECTS[c.hidden]]
    lines = [
        "# An outside truck, by its interface",
        "",
        "`python benchmarks/bench_interfaces.py`",
        "",
        f"A truck that tells none of its forces, {DRIVES} drives of {SECONDS:.0f} s. The hidden effect is",
        f"named first in {first} of {len(missing)} cases and is in the group in {group}.",
        f"Where nothing is hidden, {sum(silent)} of {len(silent)} are silent.",
        f"Corrections that validate: {sum(c.validated for c in missing)} of {len(missing)}.",
        "",
        f"Speed errors are of held-out free runs of {HORIZONS_S[0]:.0f} s, m/s: as given, parameters alone,",
        "corrected.",
        "",
        "| interface | hidden | told first | not distinguishable from | as given | parameters | corrected |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for c in cases:
        told = f"`{c.first}`" if c.first else "nothing"
        beside = ", ".join(f"`{b}`" for b in c.beside)
        errors = f"{c.before:.3f} | {c.parameters_only:.3f} | {c.after:.3f}"
        lines.append(f"| {c.interface} | {c.hidden} | {told} | {beside} | {errors} |")
    return lines


def main() -> None:
    """Print the table and write it to docs/results/interfaces.md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--work", type=Path, default=Path("runs/interfaces"))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep-page", action="store_true", help="print only")
    args = parser.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    brakes = ("brake_lag", "brake_fade")
    plan = [
        (name, hidden)
        for name, (truck, _) in INTERFACES.items()
        for hidden in EFFECTS
        if truck.interface.brake_unit or hidden not in brakes
    ]
    with ProcessPoolExecutor(args.jobs, get_context("spawn")) as pool:
        waiting = [pool.submit(case, *job, args.work) for job in plan]
        for k, done in enumerate(as_completed(waiting), 1):
            done.result()
            print(f"{k} of {len(waiting)}", flush=True)
    lines = page([future.result() for future in waiting])
    print("\n".join(lines))
    if not args.keep_page:
        RESULTS.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()

"""Drives a simulator for a few seconds and checks that it satisfies the protocol `simulators.Simulator`.

Each probe returns what it found, or raises: `MissingError` for what every tool here needs, `NotedError` for
what only some need. An exception in the simulator's code counts as missing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from deeptruck_core import reading
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELERATION, CHANNELS, SPEED, TruckInterface
from deeptruck_model.simulators import Simulator
from deeptruck_model.simulators.running import difference

SPEEDS = (0.0, 8.0, 20.0)  # m/s, of one batch
DRIVE_S, ROLLOUT_S = 6.0, 600.0
ENGINE = {"N m": 1000.0, "percent": 50.0, "g/s": 10.0, "cm^3/s": 12.0}  # about half of what a truck has
BRAKE = {"percent": 40.0, "m/s^2": 2.0, "bar": 3.0}
GRADE = 0.03
SEEN = 0.05  # m/s after DRIVE_S, by which a command shows
ROUNDING = 0.02  # m/s^2, between acceleration and the change of speed
LIKELY = 10.0  # m/s^2, more than any truck
FORCES = ("traction_force", "brake_force", "drag_force", "rolling_force", "mass")  # of inside(), N and kg
APART, APART_M_S2 = 0.5, 0.05  # that forces may be off: rotating masses in low gears, and a step's delay


class Mark(StrEnum):
    """Whether a requirement is met; `note` is for one that only some tools have."""

    YES = "yes"
    NOTE = "note"
    NO = "NO"


@dataclass(frozen=True)
class Row:
    """One line of the table: `mend` is the remedy if something is missing."""

    about: str
    state: Mark
    says: str
    mend: str = ""


class MissingError(Exception):
    """A required property that is missing, and its remedy."""


class NotedError(Exception):
    """A missing property that only some tools need, and its remedy."""


def examine(simulator: Simulator, say: Callable[[str], None] = lambda step: None) -> list[Row]:
    """A row for each probe. The simulator is only driven from copies of its own states. `say` gets how
    far the probes are."""
    rows: list[Row] = []
    for k, (about, probe) in enumerate(PROBES):
        say(f"checking the simulator, {k / len(PROBES):.0%}")
        row = _row(about, probe, simulator)
        same = next((r for r in rows if r.state is row.state is Mark.NO and r.says == row.says), None)
        rows.append(row if same is None else replace(row, says=f"as at {same.about}", mend=""))
    return rows


def missing(rows: Sequence[Row]) -> list[Row]:
    """The rows that prevent the use of the simulator."""
    return [row for row in rows if row.state is Mark.NO]


def _row(about: str, probe: Callable[[Simulator], str], simulator: Simulator) -> Row:
    try:
        return Row(about, Mark.YES, probe(simulator))
    except MissingError as what:
        return Row(about, Mark.NO, *what.args)
    except NotedError as what:
        return Row(about, Mark.NOTE, *what.args)
    except Exception as error:  # of somebody else's code
        said = str(error) if isinstance(error, InputError) else repr(error)
        return Row(about, Mark.NO, reading.plain(said, reading.MOST_SAID), "mend what is said there")


def start(simulator: Simulator, *speeds: float) -> Any:
    """A state with these speeds, one per batch row."""
    y0 = np.zeros((len(speeds), len(simulator.interface.y)))
    y0[:, SPEED] = speeds
    return simulator.reset(y0)


def commands(interface: TruckInterface, batch: int, engine: float = 0.0, brake: float = 0.0) -> Array:
    """Constant commands (batch, n_u) in the units of the interface."""
    return np.tile([engine, brake][: len(interface.u)], (batch, 1))


def road(interface: TruckInterface, batch: int, grade: float = 0.0) -> Array:
    """A constant slope (batch, n_w)."""
    return np.full((batch, len(interface.w)), grade)


def drive(
    simulator: Simulator, speeds: Sequence[float], engine: float = 0.0, brake: float = 0.0, grade: float = 0.0
) -> Array:
    """y (steps, batch, n_y) over DRIVE_S."""
    state, batch, i = start(simulator, *speeds), len(speeds), simulator.interface
    out = []
    for _ in range(max(2, round(DRIVE_S / simulator.dt))):
        state, y = simulator.step(state, commands(i, batch, engine, brake), road(i, batch, grade))
        out.append(y)
    return np.array(out)


def _idle(simulator: Simulator, state: Any, batch: int) -> tuple[Any, Array]:
    i = simulator.interface
    return simulator.step(state, commands(i, batch), road(i, batch))


def _interface(s: Simulator) -> str:
    i = s.interface
    w = ", ".join(i.w) or "no grade"
    return f"takes {', '.join(f'{n} in {i.unit(n)}' for n in i.u)}, {w}; answers {', '.join(i.y)}"


def _dt(s: Simulator) -> str:
    if not 0.0 < s.dt <= 60.0:
        raise MissingError(f"a step of {s.dt} s", "give s, above 0 and at most 60")
    if s.dt > 0.1 + 1e-9:
        raise NotedError(f"a step of {s.dt:g} s", "0.1 s or less follows what brakes and a controller do")
    return f"a step of {s.dt:g} s; recordings are read at {1 / s.dt:g} Hz for it"


def _reset_and_step(s: Simulator) -> str:
    y = drive(s, SPEEDS)
    expected = (len(y), len(SPEEDS), len(s.interface.y))
    if y.shape != expected or not np.isfinite(y).all():
        raise MissingError(f"y of {y.shape}, or no number", f"answer finite numbers of {expected[1:]}")
    first = _idle(s, start(s, 20.0), 1)[1][0, SPEED]
    if abs(first - 20.0) > LIKELY * s.dt:
        raise MissingError(
            f"{first:.3g} m/s one step after a reset at 20 m/s", "begin at y0, and answer speed in m/s"
        )
    return f"{DRIVE_S:g} s from {', '.join(f'{v:g}' for v in SPEEDS)} m/s at idle, all numbers"


def _acceleration(s: Simulator) -> str:
    y = drive(s, SPEEDS, engine=ENGINE[s.interface.engine_unit])
    speed = np.concatenate([np.array(SPEEDS)[None], y[:, :, SPEED]])
    off = np.abs(np.diff(speed, axis=0) / s.dt - y[:, :, ACCELERATION]).max()
    if off > ROUNDING:
        raise MissingError(
            f"acceleration is up to {off:.2g} m/s^2 from the change of speed over dt",
            "answer the mean acceleration over the step, in m/s^2: (v after - v before) / dt",
        )
    return f"acceleration is the change of speed over dt, to {off:.1g} m/s^2"


def _time(s: Simulator) -> str:
    begun = time.process_time()  # not what other processes took
    steps = len(drive(s, SPEEDS))
    step_s = (time.process_time() - begun) / steps
    return f"{1000.0 * step_s:.2g} ms a step of {len(SPEEDS)} rows"


def _batches(s: Simulator) -> str:
    together = drive(s, SPEEDS, engine=ENGINE[s.interface.engine_unit])
    for row, speed in enumerate(SPEEDS):
        alone = drive(s, [speed], engine=ENGINE[s.interface.engine_unit])[:, 0]
        if not np.allclose(alone, together[:, row], rtol=1e-6, atol=1e-6):
            raise MissingError(f"from {speed:g} m/s it drives otherwise in a batch", "keep the rows apart")
    return "a batch drives as each of its rows does alone"


def _repeats(s: Simulator) -> str:
    first, again = (drive(s, SPEEDS, engine=ENGINE[s.interface.engine_unit]) for _ in range(2))
    if not np.array_equal(first, again):
        raise MissingError(
            "the same drive differs when repeated", "keep no memory but in the state; fix the seed"
        )
    return "the same drive twice is the same to the last digit"


def _old_states(s: Simulator) -> str:
    state, i = start(s, 15.0), s.interface
    state, _ = _idle(s, state, 1)
    before = _idle(s, state, 1)[1]
    s.force(s.step(state, commands(i, 1, engine=ENGINE[i.engine_unit]), road(i, 1))[0], before * 0.5)
    s.force(state, before * 0.5)
    if not np.array_equal(before, _idle(s, state, 1)[1]):
        raise MissingError(
            "step or force changes the state that it is given", "return a copy: copy.deepcopy(state)"
        )
    return "step and force leave the state usable that they are given"


def _force(s: Simulator) -> str:
    state, y = _idle(s, start(s, 10.0), 1)
    forced = y.copy()
    forced[:, SPEED] = 20.0
    speed = _idle(s, s.force(state, forced), 1)[1][0, SPEED]
    if abs(speed - 20.0) > LIKELY * s.dt:
        raise MissingError(f"{speed:.3g} m/s after force() to 20 m/s", "take the y that force is given")
    if getattr(s, "starts_anew", False):
        raise NotedError(
            "it has no force: it starts anew at each recorded response",
            "add force(state, y) -> state where gears, boost or brake pressure must be kept",
        )
    return "goes on from a recorded response"


def _force_of_nothing(s: Simulator) -> str:
    state, y = _idle(s, start(s, 10.0), 1)
    kept, own = _idle(s, s.force(state, np.full_like(y, np.nan)), 1)[1], _idle(s, state, 1)[1]
    if not np.allclose(kept, own, atol=1e-9):
        raise MissingError("force() with NaN changes what follows", "keep your own response where y is NaN")
    alone = np.full_like(y, np.nan)
    alone[:, SPEED] = 10.0
    if not np.isfinite(_idle(s, s.force(state, alone), 1)[1]).all():
        raise MissingError(
            "force() with speed alone makes no number", "keep your own response where y is NaN"
        )
    return "keeps its own response where nothing was recorded"


def _rollout(s: Simulator) -> str:
    if not hasattr(s, "rollout"):
        return "none: whole drives go by its steps"
    n, i = round(ROLLOUT_S / s.dt), s.interface
    rng = np.random.default_rng(0)
    held = np.repeat(rng.uniform(0.0, 1.0, (-(-n // 50), 2)), 50, axis=0)[:n]
    u = held * [ENGINE[i.engine_unit], BRAKE[i.brake_unit] * 0.1 if i.brake_unit else 0.0]
    w = np.repeat(rng.uniform(-GRADE, GRADE, (-(-n // 100), 1)), 100, axis=0)[:n]
    y0 = np.zeros((1, len(i.y)))
    y0[:, SPEED] = 15.0
    if says := difference(s, u[None, :, : len(i.u)], w[None, :, : len(i.w)], y0, None):
        raise MissingError(f"it {says}", "mend it, or leave it out: whole drives go by steps then")
    return f"drives as its steps do over {ROLLOUT_S:g} s in rows of their own, free, forced, and both in turn"


def _obeys(s: Simulator, name: str, more: dict[str, float], sign: float, said: str) -> str:
    change = sign * (drive(s, [15.0], **more) - drive(s, [15.0]))[-1, 0, SPEED]
    amount = next(iter(more.values()))
    unit = s.interface.unit(name)
    if change < SEEN:
        what = "hardly anything" if change > -SEEN else "the opposite"
        raise MissingError(
            f"{name} of {amount:g} {unit} does {what}", f"look at its column, unit ({unit}) and sign"
        )
    if change > LIKELY * DRIVE_S:
        raise MissingError(
            f"{name} of {amount:g} {unit} changes speed by {change:.2g} m/s in {DRIVE_S:g} s, as in no truck",
            f"look at its column and unit ({unit})",
        )
    return f"{amount:g} {unit} {said} it by {change:.2g} m/s in {DRIVE_S:g} s"


def _engine(s: Simulator) -> str:
    return _obeys(s, "engine_command", {"engine": ENGINE[s.interface.engine_unit]}, 1.0, "drives")


def _brake(s: Simulator) -> str:
    unit = s.interface.brake_unit
    if unit is None:
        raise NotedError(
            "no brake command", "controllers and the emulator need one; the mismatch tool coasts"
        )
    return _obeys(s, "brake_command", {"brake": BRAKE[unit]}, -1.0, "slows")


def _grade(s: Simulator) -> str:
    if not s.interface.grade:
        raise NotedError("no grade", "recordings on hills show as a mismatch; take the grade in w")
    return _obeys(s, "grade", {"grade": GRADE}, -1.0, "slows")


def _command_of_nothing(s: Simulator) -> str:
    i = s.interface
    try:
        y = s.step(start(s, 10.0), commands(i, 1, engine=np.nan), road(i, 1))[1]
    except InputError:
        return "is refused"
    if np.isfinite(y).all():
        raise NotedError("a command that is NaN is driven on with", "raise deeptruck_core.errors.InputError")
    return "is passed on as NaN"


def _inside(s: Simulator) -> str:
    batch = len(SPEEDS)
    state = _idle(s, start(s, *SPEEDS), batch)[0]
    seen = s.inside(state)
    if not seen:
        raise NotedError("states nothing", "gear, engine_speed and forces in inside() help the mismatch tool")
    for name, x in seen.items():
        if np.shape(x) != (batch,):
            raise MissingError(f"inside has {name} of {np.shape(x)}", f"give one value a row: ({batch},)")
        if not np.isfinite(x).all():
            raise MissingError(f"inside has {name} that is not finite", "give numbers, or leave it out")
        c = CHANNELS.get(name)
        if c is None:
            continue
        if (out := ~((np.asarray(x) >= c.low) & (np.asarray(x) <= c.high))).any():
            row = int(np.argmax(out))
            raise MissingError(
                f"inside has {name} {float(x[row]):g} {c.unit} at {SPEEDS[row]:g} m/s, beyond {c.low:g} to "
                f"{c.high:g}",
                f"give it in {c.unit}; let reset and force choose a gear that suits the speed",
            )
    return ", ".join(seen)


def _forces(s: Simulator) -> str:
    seen = s.inside(start(s, 15.0))
    lacking = [name for name in FORCES if name not in seen]
    if "traction_force" in seen and lacking:
        raise MissingError(
            f"inside() has traction_force and not {', '.join(lacking)}",
            "report all of these, or no traction_force",
        )
    if lacking:
        raise NotedError(
            "the mismatch tool splits them from its acceleration", f"report {', '.join(FORCES)} in inside()"
        )
    brakes = [{"brake": BRAKE[s.interface.brake_unit]}] if s.interface.brake_unit else []
    for pedal in ({"engine": ENGINE[s.interface.engine_unit]}, {}, *brakes):
        state, y = start(s, 15.0), np.zeros((1, 2))
        for _ in range(max(2, round(DRIVE_S / s.dt))):
            state, y = s.step(state, commands(s.interface, 1, **pedal), road(s.interface, 1))
        traction, *against, mass = (float(s.inside(state)[name][0]) for name in FORCES)
        forces, needed = traction - sum(map(abs, against)), mass * float(y[0, ACCELERATION])
        if abs(forces - needed) > APART * max(abs(forces), abs(needed)) + APART_M_S2 * mass:
            doing = next(iter(pedal), "no pedal")
            raise NotedError(
                f"add up to {forces:.0f} N with {doing}, and mass by acceleration is {needed:.0f} N",
                "report all of them in N, and mass in kg; traction is positive forwards",
            )
    return "traction, brake, drag and rolling are its own"


def _parameters(s: Simulator) -> str:
    own = s.parameters()
    if not own:
        raise NotedError("none", "with parameters() and with_parameters() the mismatch tool refits them")
    bad = [name for name, value in own.items() if not np.isfinite(value)]
    if bad:
        raise MissingError(f"{', '.join(bad)} is no finite number", "give SI numbers, or leave it out")
    name = "mass" if "mass" in own else next(name for name in own)
    value = own[name] * 1.04
    try:
        other = s.with_parameters({name: value}).parameters()
    except InputError:  # of one at its upper bound
        value = own[name] * 0.96
        other = s.with_parameters({name: value}).parameters()
    if s.parameters() != own or not np.isclose(other[name], value):
        raise MissingError(
            f"with_parameters of {name} changes the simulator itself, or nothing", "return a changed copy"
        )
    return f"{len(own)}: {', '.join(list(own)[:8])}{' ...' if len(own) > 8 else ''}"


PROBES: tuple[tuple[str, Callable[[Simulator], str]], ...] = (
    ("interface", _interface),
    ("dt", _dt),
    ("reset, step", _reset_and_step),
    ("step", _time),
    ("acceleration", _acceleration),
    ("batches", _batches),
    ("determinism", _repeats),
    ("old states", _old_states),
    ("force", _force),
    ("force with NaN", _force_of_nothing),
    ("rollout", _rollout),
    ("engine command", _engine),
    ("brake command", _brake),
    ("grade", _grade),
    ("command of NaN", _command_of_nothing),
    ("inside", _inside),
    ("forces", _forces),
    ("parameters", _parameters),
)

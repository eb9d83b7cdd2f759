"""What the mismatch tool can identify with a simulator, by the quantities that the simulator reports."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from deeptruck_core.signals import ACCELERATION, SPEED
from deeptruck_model.mismatch.residual import gather
from deeptruck_model.mismatch.residual.components import FORCES
from deeptruck_model.mismatch.residual.gather import REFIT_PARAMETERS, accepted
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.simulators import Simulator, forced_run
from deeptruck_model.simulators.protocol_check import (
    BRAKE,
    DRIVE_S,
    ENGINE,
    Mark,
    Row,
    commands,
    drive,
    road,
    start,
)

AGAINST = ("brake_force", "drag_force", "rolling_force")
APART, APART_M_S2 = 0.5, 0.05  # that forces may be off: rotating masses in low gears, and a step's delay
STEP = 0.2  # relative change of a parameter
TIMED_S, TEN_MINUTES_S, SLOW_S = 20.0, 600.0, 20.0  # of the drives that are timed; what a user waits for
DRIVES = 6  # that the stated time is for
AGAIN, FREE_RUNS = 1.5, 4.0  # passes along all drives, of one linearisation, and of free runs: counted
STEPPED = 1.0  # of the free runs, with a force added: they go step by step even where there is a rollout


def rows(simulator: Simulator) -> list[Row]:
    """Statements on what the mismatch tool can identify with `simulator`, which passed the protocol check."""
    seen = simulator.inside(start(simulator, 15.0))
    own = simulator.parameters()
    out = [
        _refitted(simulator),
        _components(simulator, set(seen)),
        _newtons(set(seen), own, simulator.interface.mass_kg),
        _gears(set(seen)),
        _time(simulator),
    ]
    return out if own or FORCES[0] in seen else [*out, _learned(simulator)]


def _refitted(s: Simulator) -> Row:
    own = s.parameters()
    named = [name for name in REFIT_PARAMETERS if own.get(name)]
    moves = [name for name in named if _moves(s, name, own[name])]
    idle = ", ".join(name for name in named if name not in moves)
    rest = ", ".join(name for name in REFIT_PARAMETERS if name not in named) or "none"
    says = f"{', '.join(moves) or 'none'}; as an added force: {rest}"
    if idle:
        mend = "make with_parameters act on what drives, or leave them out of parameters()"
        return Row("refitted", Mark.NO, f"{idle} changes nothing of a drive", mend)
    mend = "" if moves else f"report and take any of {', '.join(REFIT_PARAMETERS)} as parameters"
    return Row("refitted", Mark.YES if moves else Mark.NOTE, says, mend)


def _moves(s: Simulator, name: str, value: float) -> bool:
    """Whether a parameter value above the simulator's own changes the motion, or one below if its value is at
    the upper bound."""
    change = accepted(s, {name: STEP})[name] or accepted(s, {name: -STEP})[name]
    i, other = s.interface, s.with_parameters({name: value * (1 + change)})
    pedals = [{"engine": ENGINE[i.engine_unit]}]
    pedals += [] if i.brake_unit is None else [{"brake": BRAKE[i.brake_unit]}]
    apart = [(drive(s, [15.0], **p) - drive(other, [15.0], **p))[:, 0, SPEED] for p in pedals]
    return max(float(np.abs(x).max()) for x in apart) > Limits.least_effect


def _components(s: Simulator, seen: set[str]) -> Row:
    lacking = [name for name in FORCES if name not in seen]
    if "traction_force" in seen and lacking:
        mend = "report all of these, or no traction_force"
        return Row("forces", Mark.NO, f"inside() has traction_force and not {', '.join(lacking)}", mend)
    if not lacking:
        return _balance(s)
    says = "split from its acceleration by recorded engine_torque and engine_speed, else fuel_rate"
    return Row("forces", Mark.NOTE, says, f"report {', '.join(FORCES)} in inside(), in SI")


def _balance(s: Simulator) -> Row:
    """Whether mass times acceleration is about the sum of the reported forces, on a level road."""
    pedals = [{"engine": ENGINE[s.interface.engine_unit]}, {}]
    pedals += [] if s.interface.brake_unit is None else [{"brake": BRAKE[s.interface.brake_unit]}]
    for pedal in pedals:
        state, y = start(s, 15.0), np.zeros((1, 2))
        for _ in range(max(2, round(DRIVE_S / s.dt))):
            state, y = s.step(state, commands(s.interface, 1, **pedal), road(s.interface, 1))
        f = {name: float(x[0]) for name, x in s.inside(state).items() if name in FORCES}
        forces = f["traction_force"] - sum(abs(f[name]) for name in AGAINST)
        needed = f["mass"] * float(y[0, ACCELERATION])
        if abs(forces - needed) > APART * max(abs(forces), abs(needed)) + APART_M_S2 * f["mass"]:
            doing = next(iter(pedal), "no pedal")
            mend = "report all of them in N, and mass in kg; traction is positive forwards"
            says = f"add up to {forces:.0f} N with {doing}, and mass by acceleration is {needed:.0f} N"
            return Row("forces", Mark.NOTE, says, mend)
    return Row("forces", Mark.YES, "traction, brake, drag and rolling are its own")


def _newtons(seen: set[str], own: dict[str, float], stated_kg: float | None) -> Row:
    if "mass" in own or "traction_force" in seen or stated_kg is not None:
        return Row("forces in N", Mark.YES, "by its own mass")
    mend = "report mass (kg) in parameters(), or state it: mass_kg in COLUMNS.yaml, or --mass-kg"
    return Row("forces in N", Mark.NOTE, "given in m/s^2, as no mass is stated", mend)


def _gears(seen: set[str]) -> Row:
    reported = [name for name in ("gear", "engine_speed") if name in seen]
    if reported:
        return Row("gears", Mark.YES, f"{', '.join(reported)} beside what is recorded, where it is")
    says = "driving in another gear than was recorded is not seen"
    return Row("gears", Mark.NOTE, says, "report gear and engine_speed (rad/s) in inside()")


def _time(s: Simulator) -> Row:
    """What `mismatch` takes of the simulator for DRIVES drives of TEN_MINUTES_S, by the time of short ones,
    which are run at once."""
    n = round(TIMED_S / s.dt)
    u, w = np.zeros((DRIVES, n, len(s.interface.u))), np.zeros((DRIVES, n, len(s.interface.w)))
    y = np.zeros((DRIVES, n, len(s.interface.y)))
    y[:, :, SPEED] = 15.0

    def stepped() -> None:
        state = s.reset(y[:, 0])
        for k in range(n):
            state, _ = s.step(state, u[:, k], w[:, k])

    along, free = (_seconds(run) / n for run in (lambda: forced_run(s, u, w, y), stepped))
    others = along if hasattr(s, "rollout") else free
    each = AGAIN * gather.passes(s) * along + STEPPED * free + (FREE_RUNS - STEPPED) * others
    whole = each * TEN_MINUTES_S / s.dt
    per_step = f"{1e3 * along:.2g} ms a step along them, {1e3 * free:.2g} ms in free runs"
    says = f"{whole:.0f} s of this simulator for {DRIVES} drives of ten minutes: {per_step}"
    if whole < SLOW_S:
        return Row(
            "time", Mark.YES, says if whole >= 1.0 else f"under 1 s of it {says.partition(' for ')[2]}"
        )
    mend = "compile step() with numba, give it a rollout() of whole drives, or export it as an FMU"
    return Row("time", Mark.NOTE, says, mend)


def _seconds(run: Callable[[], object]) -> float:
    """Seconds of CPU time that a call takes; the first may compile."""
    each = []
    for _ in range(2):
        begun = time.process_time()
        run()
        each.append(time.process_time() - begun)
    return min(each)


def _learned(s: Simulator) -> Row:
    """The statement that a simulator without parameters and forces counts as learned: its errors are known
    only from its own recordings."""
    if getattr(s, "reference", ()):
        return Row("own errors", Mark.YES, "known from the recordings in its `reference`")
    says = "without parameters and forces it counts as learned, and its own errors count as the truck's"
    return Row("own errors", Mark.NOTE, says, "give recordings that it was made from as `reference`")

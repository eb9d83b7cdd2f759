"""Runs a simulator along a drive: free, fed back what was recorded, or both in turn.

A simulator may bring a `rollout` of whole drives, which is faster than its steps. One that others wrote is
compared with the steps before it is used, once, and never used where it differs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from deeptruck_core import reading
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import SPEED
from deeptruck_model.simulators.protocol import MinimalSimulator, Simulator

PROBED_S = 600.0  # of the first row of the first drive, at most
SPANS_S = (5.0, 40.0)  # of free and of forced driving, which alternate
AGREES = 1e-6  # relative, and m/s or m/s^2
DIFFERS = "its rollout() {says}; its steps are used, which take longer"


@dataclass(frozen=True)
class Run:
    """A simulated run: y (batch, T, n_y) with y[:, 0] the initial condition; inside signals (batch, T)."""

    y: Array
    inside: dict[str, Array]


def free_run(simulator: Simulator, u: Array, w: Array, y0: Array) -> Run:
    """Deployment form: the simulator is fed its own response.

    u (batch, T, n_u), w (batch, T, n_w), y0 (batch, n_y).
    """
    return run(simulator, u, w, y0, None)


def forced_run(simulator: Simulator, u: Array, w: Array, y: Array) -> Run:
    """Training form: at every step the recorded response y (batch, T, n_y) is fed back instead of the
    simulated one."""
    return run(simulator, u, w, y[:, 0], y)


def run(simulator: Simulator, u: Array, w: Array, y0: Array, recorded: Array | None) -> Run:
    """A run in which `recorded` (batch, T, n_y) is fed back, or nothing (None); where it is NaN throughout a
    row, the simulator goes on from its own response.

    By the simulator's `rollout` if it has one that drives as its steps do, else step by step.
    """
    rollout = getattr(simulator, "rollout", None)
    if rollout is None or differs(simulator, u, w, y0, recorded):
        return stepped(simulator, u, w, y0, recorded)
    made: Run = rollout(u, w, y0, recorded)
    return made


def stepped(
    simulator: Any, u: Array, w: Array, y0: Array, recorded: Array | None, *, inside: bool = True
) -> Run:
    """The same step by step, with signals `inside` or without."""
    state, out = simulator.reset(y0), [y0]
    seen = [simulator.inside(state)] if inside else []
    keeps: bool | None = None
    for k in range(u.shape[1] - 1):
        state, y = simulator.step(state, u[:, k], w[:, k])
        out.append(y)
        if inside:
            seen.append(simulator.inside(state))
        if recorded is not None:
            fed, free = recorded[:, k + 1], np.asarray(np.isnan(recorded[:, k + 1]).all(axis=1))
            if free.any() and not free.all():
                keeps = _keeps_its_own(simulator, state, u[:, k], w[:, k]) if keeps is None else keeps
                fed = fed if keeps else np.where(free[:, None], y, fed)
            if not free.all():
                state = simulator.force(state, fed)
    signals = {name: np.stack([each[name] for each in seen], axis=1) for name in (seen[0] if seen else ())}
    return Run(np.stack(out, axis=1), signals)


def _keeps_its_own(simulator: Any, state: Any, u: Array, w: Array) -> bool:
    """Whether `force` with NaN changes nothing, as the protocol asks; else its own response is fed back."""
    own = simulator.step(state, u, w)[1]
    try:
        kept = simulator.step(simulator.force(state, np.full_like(own, np.nan)), u, w)[1]
    except Exception:  # of somebody else's code, whatever it raises
        return False
    return bool(np.allclose(kept, own, rtol=AGREES, atol=AGREES))


_judged: WeakKeyDictionary[type, str] = WeakKeyDictionary()  # what is said of each class of simulators


def said_of_rollout(simulator: MinimalSimulator) -> str:
    """The remark on a `rollout` that was found to differ from the steps; empty if there is none."""
    says = _judged.get(_author(simulator), "")
    return DIFFERS.format(says=says) if says else ""


def differs(simulator: Simulator, u: Array, w: Array, y0: Array, recorded: Array | None) -> bool:
    """Whether a `rollout` that others wrote differs from the steps, along the first of these drives."""
    kind = _author(simulator)
    if kind.__module__.startswith("deeptruck_model.") or not hasattr(simulator, "step"):
        return False  # ours, which tests hold, or without steps to compare it with
    if kind not in _judged:
        n = max(2, round(PROBED_S / simulator.dt))
        along = None if recorded is None else recorded[:1, :n]
        _judged[kind] = difference(simulator, u[:1, :n], w[:1, :n], y0[:1], along)
    return bool(_judged[kind])


def difference(simulator: Simulator, u: Array, w: Array, y0: Array, recorded: Array | None) -> str:
    """Where and by how much a `rollout` differs from the steps along one drive, u (1, T, n_u); empty if it
    does not. Three rows begin alike and go along the drive from its start, a third and two thirds of it, so
    that no two have the same commands and slopes: one forced, one free, one both in turn, at drawn places.
    What is fed back is the drive as `recorded`, or else a little faster than its own."""
    rollout: Callable[..., Run] = simulator.rollout  # type: ignore[attr-defined]
    try:
        if recorded is None:
            recorded = stepped(simulator, u, w, y0, None, inside=False).y
            recorded[:, 1:, SPEED] *= 1.02
        begins = (0, u.shape[1] // 3, 2 * u.shape[1] // 3)
        u, w, fed = (np.concatenate([np.roll(x, -k, axis=1) for k in begins]) for x in (u, w, recorded))
        y0 = np.repeat(y0, 3, axis=0)
        fed[1] = np.nan
        fed[2, _free_spans(u.shape[1], simulator.dt)] = np.nan
        expected = stepped(simulator, u, w, y0, fed)
        found, alone = rollout(u, w, y0, fed), rollout(u[1:2], w[1:2], y0[1:2], None)
        answers = {"y": (found.y, expected.y), "y of a free run": (alone.y, expected.y[1:2])}
        answers |= {name: (found.inside[name], x) for name, x in expected.inside.items()}
    except Exception as error:  # of somebody else's code, whatever it raises
        said = str(error) if isinstance(error, InputError) else repr(error)
        return f"cannot be run ({reading.plain(said, reading.MOST_SAID)})"
    for name, (own, of_steps) in answers.items():
        if np.shape(own) != of_steps.shape:
            return f"answers {name} of {np.shape(own)}, its steps {of_steps.shape}"
        if name == "y" and not np.allclose(own[:, 0], y0, rtol=AGREES, atol=AGREES, equal_nan=True):
            return "answers y whose y[:, 0] is not y0, the start; the response to u[:, 0] is y[:, 1]"
        off = ~np.isclose(own[:, 1:], of_steps[:, 1:], rtol=AGREES, atol=AGREES, equal_nan=False)
        if off.any():
            first = int(np.flatnonzero(off.reshape(len(off), off.shape[1], -1).any(axis=(0, 2)))[0])
            return f"differs from its steps in {name} from {(first + 1) * simulator.dt:.1f} s of a drive on"
    return ""


def _free_spans(steps: int, dt: float) -> NDArray[np.bool_]:
    """Free samples (steps,) in spans of drawn lengths, which alternate with forced ones."""
    rng, out, k, on = np.random.default_rng(0), np.zeros(steps, dtype=bool), 0, False
    while k < steps:
        n = max(1, round(float(rng.uniform(*SPANS_S)) / dt))
        out[k : k + n], k, on = on, k + n, not on
    return out


def _author(simulator: Any) -> type:
    """The class that has the `rollout`: inside a wrapper, that of the object that somebody wrote."""
    return type(getattr(simulator, "_inner", simulator))

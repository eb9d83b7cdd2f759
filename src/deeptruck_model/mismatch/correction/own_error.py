"""How a simulator drives along what was held out beside how it drives elsewhere: a learned one along
recordings of its own truck, any along what was fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtrc, ndtr

from deeptruck_model.mismatch.correction.improvement import ENOUGH, free_windows
from deeptruck_model.mismatch.fit_result import FitResult
from deeptruck_model.mismatch.posterior.nuisances import kept
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.posterior.windows import near_other_gear
from deeptruck_model.mismatch.residual.evidence import SLOW_NOISE_S, Evidence
from deeptruck_model.mismatch.result import Regime
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.simulators import Simulator
from deeptruck_model.vehicle_kinds import CLUTCH_CLOSED

Array = NDArray[np.float64]

DIFFERS = (
    "the learned simulator is {here:.2g} m/s off in free runs of {horizon_s:.0f} s, and {own:.2g} m/s on "
    "drives of its own truck: something differs{where}, and no name for it is sure"
)
FOR_LONG = (
    "the simulator is up to {worst:.2g} m/s^2 off in the mean over {per_s:.0f} s, in {off} of {count} such "
    "times by more than noise may be{where}, and no name for it is sure"
)
BEYOND = 3.0  # sd of such a mean, which 1 in 370 of noise alone exceeds
SELDOM = 1e-3  # probability that so many exceed it, below which they are no noise
KNOWN = 0.6  # of such a time that must be compared
EVERYWHERE = "everywhere"
THERE_ALONE = (
    "the simulator is {here:.2g} m/s^2 off for tens of seconds along '{name}', which was held out, and "
    "{own:.2g} m/s^2 along what was fitted: what acts there was not fitted; fit it too, and hold out another"
)


def differs(
    simulator: Simulator, measured: bool, fit: FitResult, regimes: Sequence[Regime], rules: Rules
) -> str:
    """That it drives clearly worse on the held-out recordings than on those it keeps, by how much and where;
    empty where it does not, or that is not known."""
    own = speed_error(simulator, measured, fit.horizon_s)
    here = fit.errors.before.speed if fit.errors is not None else 0.0
    if own is None or here <= rules.drives_worse * own:
        return ""
    return DIFFERS.format(here=here, own=own, horizon_s=fit.horizon_s, where=_most_where(regimes))


def _most_where(regimes: Sequence[Regime]) -> str:
    where = next((r.where for r in regimes if r.bounds), EVERYWHERE)
    return "" if where == EVERYWHERE else f", most where {where}"


def off_for_long(e: Evidence, null: Model, regimes: Sequence[Regime]) -> str:
    """That the simulator is off for ten seconds and more oftener than slow noise is; else empty. `null` is
    the explanation without a name. Of a learned simulator that keeps recordings these tell (`differs`)."""
    if e.itself is not None:
        return ""
    means, sd = _slow_means(e, e.residual - Search(e).prediction(null))
    off = np.abs(means) > BEYOND * sd
    if bdtrc(off.sum() - 1, len(means), 2.0 * ndtr(-BEYOND)) > SELDOM:
        return ""
    return FOR_LONG.format(
        worst=np.abs(means).max(),
        per_s=SLOW_NOISE_S,
        off=off.sum(),
        count=len(means),
        where=_most_where(regimes),
    )


def _slow_means(e: Evidence, left: Array) -> tuple[Array, Array]:
    """Means (m,) of what is `left` (n,), m/s^2, over as long as noise may still be slow, and the sd of each:
    of slow noise, and of the noise that its own seconds show. None while it creeps or shifts otherwise."""
    known = e.valid & ~near_other_gear(e) & (e["speed"] > CLUTCH_CLOSED)
    per, second = (max(1, round(seconds / e.dt)) for seconds in (SLOW_NOISE_S, 1.0))
    means, spread = [], []
    for s in e.stretches:
        for start in range(s.start, s.stop - per + 1, per):
            rows = np.arange(start, start + per)[known[start : start + per]]
            if len(rows) < KNOWN * per:
                continue
            of_seconds = left[rows[: len(rows) // second * second]].reshape(-1, second).mean(axis=1)
            means.append(float(left[rows].mean()))
            spread.append(float(of_seconds.std(ddof=1)) / np.sqrt(len(of_seconds)))
    return np.array(means), np.hypot(e.slow_noise, np.array(spread))


def speed_error(simulator: Simulator, measured: bool, horizon_s: float) -> float | None:
    """Rms speed error (m/s) of a learned simulator in free runs along the recordings that it keeps."""
    own = kept(simulator, measured)
    errors = free_windows(simulator, own, horizon_s)
    return errors.rmse().speed if len(errors.speed) else None


def acts_there_alone(e: Evidence, null: Model) -> str:
    """That a drive is off for tens of seconds though it was held out, as no fitted one is; empty where none
    is so. `null` is the explanation without a name. Told by means of the residual, where what shifts
    otherwise by little is short."""
    off = _typically_off(e, e.residual - Search(e).prediction(null))
    here = {name: size for name, held_out, size in off if held_out}
    own = [size for _, held_out, size in off if not held_out]
    if not here or not own:
        return ""
    worst = max(here, key=here.__getitem__)
    if here[worst] <= max(e.rules.slow_noise, e.rules.allowance * max(own)):
        return ""
    return THERE_ALONE.format(here=here[worst], name=worst, own=max(own))


def _typically_off(e: Evidence, left: Array) -> list[tuple[str, bool, float]]:
    """Each drive with enough driving: its name, whether it was held out, and the median size of what is
    `left` (n,), m/s^2, in the mean over as long as noise may still be slow."""
    out, per = [], max(1, round(SLOW_NOISE_S / e.dt))
    for s in e.stretches:
        rows = np.arange(s.start, s.start + (s.stop - s.start) // per * per).reshape(-1, per)
        means = np.abs(left[rows[e.valid[rows].all(axis=1)]].mean(axis=1))
        if len(means) >= ENOUGH:
            out.append((s.name, s.held_out, float(np.median(means))))
    return out

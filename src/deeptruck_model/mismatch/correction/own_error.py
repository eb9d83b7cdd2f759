"""How a learned simulator drives here beside how it drives on recordings of its own truck."""

from __future__ import annotations

from collections.abc import Sequence

from deeptruck_model.mismatch.correction.improvement import free_windows
from deeptruck_model.mismatch.fit_result import FitResult
from deeptruck_model.mismatch.posterior.nuisances import kept
from deeptruck_model.mismatch.result import Regime
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.simulators import Simulator

DIFFERS = (
    "the learned simulator is {here:.2g} m/s off in free runs of {horizon_s:.0f} s, and {own:.2g} m/s on "
    "drives of its own truck: something differs{where}, and no name for it is sure"
)
EVERYWHERE = "everywhere"


def differs(
    simulator: Simulator, measured: bool, fit: FitResult, regimes: Sequence[Regime], rules: Rules
) -> str:
    """That it drives clearly worse on the held-out recordings than on those it keeps, by how much and where;
    empty where it does not, or that is not known."""
    own = speed_error(simulator, measured, fit.horizon_s)
    here = fit.errors.before.speed if fit.errors is not None else 0.0
    if own is None or here <= rules.drives_worse * own:
        return ""
    where = next((r.where for r in regimes if r.bounds), EVERYWHERE)
    told = "" if where == EVERYWHERE else f", most where {where}"
    return DIFFERS.format(here=here, own=own, horizon_s=fit.horizon_s, where=told)


def speed_error(simulator: Simulator, measured: bool, horizon_s: float) -> float | None:
    """Rms speed error (m/s) of a learned simulator in free runs along the recordings that it keeps."""
    own = kept(simulator, measured)
    errors = free_windows(simulator, own, horizon_s)
    return errors.rmse().speed if len(errors.speed) else None

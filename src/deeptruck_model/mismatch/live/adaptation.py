"""Estimates load, wind and a constant force per mass from the first minutes of a drive.

They differ from drive to day and cannot be learned from other drives. Each is a block of the posterior by
which mechanisms are named, estimated together with slow drift, an unrecorded slope and effects of other
signals.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from deeptruck_core.arrays import Array
from deeptruck_core.constants import GRAVITY
from deeptruck_core.errors import InputError
from deeptruck_core.terminal.progress import steps
from deeptruck_core.vehicle_kinds import STEEPEST
from deeptruck_model.checks import calls
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.live.questions import DriveState, Quantity, State
from deeptruck_model.mismatch.mechanisms import LIBRARY, Variant, candidate_term, variant
from deeptruck_model.mismatch.posterior.kernels import Kernel
from deeptruck_model.mismatch.posterior.posterior import DRIFT_ODDS, Posterior, posterior
from deeptruck_model.mismatch.posterior.reference_error import with_reference_error
from deeptruck_model.mismatch.posterior.regression import FREE, Regression, changed_by
from deeptruck_model.mismatch.prepare.drives import clean, same_signals
from deeptruck_model.mismatch.prepare.prepared import Prepared, learned, prepare
from deeptruck_model.mismatch.prepare.sensors import acceleration_is_measured
from deeptruck_model.mismatch.residual.components import Shares
from deeptruck_model.mismatch.residual.gather import gather
from deeptruck_model.mismatch.residual.left_out import braking
from deeptruck_model.mismatch.residual.noise import Z95
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.several import Drives
from deeptruck_model.recordings.several import drives as known
from deeptruck_model.simulators import MinimalSimulator, Simulator, completed

FIRST_S = 300.0
SLOPE = "road_grade"  # whose kernel the posterior has of itself where none was recorded
LOAD, BIAS, WIND = "mass", "grade_bias", "headwind"
STEADY: dict[str, Variant] = {BIAS: variant("offset"), WIND: variant("each drive", around_m_s=0.0)}
SD = {LOAD: FREE["mass"], BIAS: 0.03 / GRAVITY, WIND: 4.0}  # relative, rise over run, m/s: between drives
STRONGEST = {BIAS: STEEPEST, WIND: Limits.mean_wind}  # what no drive has throughout


@dataclass(frozen=True)
class Adapted:
    """The simulator adapted to one drive, with the estimates of that drive's load, wind and constant
    force."""

    truck: CorrectedTruck
    own: DriveState

    @property
    def constant(self) -> float:
        """The constant acceleration that was added, m/s^2."""
        return self.own.used("constant")

    @property
    def sd(self) -> float:
        """Standard deviation of the constant, m/s^2, from its 95 % interval."""
        low, high = self.own.constant.ci95
        return (high - low) / (2.0 * Z95)


def with_state(simulator: Simulator, state: DriveState) -> CorrectedTruck:
    """The simulator with the load, wind and constant force estimated for a drive."""
    sizes = {WIND: state.used("wind"), BIAS: -state.used("constant") / GRAVITY}
    terms = [Term(name, (STEADY[name],), (size,)) for name, size in sizes.items() if size]
    load = state.used("load")
    return CorrectedTruck(simulator, terms, {LOAD: load} if load else {}, state.shares, True)


def adapt(
    simulator: MinimalSimulator | str | Path,
    recordings: Drives,
    first_s: float = FIRST_S,
    *,
    rules: Rules = Rules(),
    say: Callable[[str], None] | None = None,
) -> Adapted:
    """Adapt the simulator to a drive, of which the recordings are the pieces, by its first `first_s` seconds.
    `say` is called with each step; without it a terminal shows them.

    The simulator may be named as for `load`, the drive by the path of its bag. Raises InputError if they do
    not belong together, or if too little of the drive can be compared.
    """
    calls.number(first_s, "first_s", "s")
    simulator = completed(simulator)
    recordings = known(recordings, rate_hz=1.0 / simulator.dt)
    with threadpool_limits(1), steps(say, "driving the simulator along the recording"):
        state = state_of(simulator, begin(simulator, recordings, first_s), rules)
    if state is None:
        raise InputError(
            f"of the first {first_s:g} s of '{recordings[0].name}' too little can be compared; "
            "record longer, or take more of it by --first-s"
        )
    return Adapted(with_state(simulator, state), state)


def state_of(simulator: Simulator, drives: Sequence[Prepared], rules: Rules) -> DriveState | None:
    """Load, wind and constant force of the drive with these prepared pieces; None if too little can be
    compared."""
    e = gather(simulator, drives, [False] * len(drives), rules=rules)
    e, _ = braking(e)
    if e.valid.sum() * e.dt < Limits.least_driving_s:
        return None
    e = with_reference_error(simulator, e, drives[0].measured_acceleration, 0)
    columns = {name: candidate_term(LIBRARY[name], STEADY[name], e).columns for name in STEADY}
    if LOAD in e.sensitivity:
        columns[LOAD] = e.sensitivity[LOAD][:, None]
    regression = Regression(replace(e, sensitivity={}), exclude=set(LIBRARY) - {SLOPE})
    blocks = [Kernel(n, SD[n] * np.nan_to_num(x), chance=DRIFT_ODDS / rules.odds) for n, x in columns.items()]
    p = posterior(regression, blocks)
    rise, wind = (_quantity(p.probability(n), _drawn(p, n), STRONGEST[n], rules) for n in STEADY)
    load = _load(p) if LOAD in columns else Quantity()
    return DriveState(load, wind, _constant(rise), float(e.valid.sum() * e.dt), Shares.if_unreported(e))


def _constant(rise: Quantity) -> Quantity:
    """An unrecorded slope, expressed as an acceleration."""
    low, high = rise.ci95
    return replace(rise, value=-GRAVITY * rise.value, ci95=(-GRAVITY * high, -GRAVITY * low))


def _drawn(p: Posterior, name: str) -> Array:
    """The size of a one-column block in each draw (m,)."""
    (j,) = (j for j, k in enumerate(p.of) if k.name == name)
    return SD[name] * p.coefficients(j)[:, 0]


def _load(p: Posterior) -> Quantity:
    """The relative change of mass."""
    low, high = p.regression.e.vehicle.possible(LOAD)
    moved = np.array([changed_by(LOAD, float(x), p.regression.mass_gain) for x in _drawn(p, LOAD)])
    q = _quantity(p.probability(LOAD), moved, np.inf, p.regression.rules)
    bent = Z95 * 0.5 * q.value**2  # what a line through the simulator's answer may be off by so far away
    beyond = q.state is State.ESTIMATED and not low < q.value < high
    return replace(
        q,
        state=State.INVALID if beyond else q.state,
        ci95=(q.ci95[0] - bent, q.ci95[1] + bent),
    )


def _quantity(probability: float, drawn: Array, most: float, rules: Rules) -> Quantity:
    """A quantity from its draws (m,): estimated from a probability of `rules.named` on, and valid up to
    `most`."""
    value = float(drawn.mean())
    low, high = (float(x) for x in np.quantile(drawn, [0.025, 0.975]))
    state = State.UNESTIMATED if probability < rules.named else State.ESTIMATED
    state = State.INVALID if state is State.ESTIMATED and abs(value) > most else state
    return Quantity(state, value, (low, high), probability)


def begin(simulator: Simulator, recordings: Sequence[Recording], first_s: float) -> list[Prepared]:
    """The first `first_s` seconds of a drive, possibly cut into pieces, prepared for the simulator."""
    same_signals(simulator, recordings)
    pieces, left = [], first_s
    for r in recordings:
        n = min(len(r), round(left / r.dt))
        if n > 1:
            pieces.append(r.piece(0, n))
        left -= n * r.dt
    drives, _ = clean(pieces)
    measured = acceleration_is_measured(drives)
    return [learned(simulator, prepare(r, measured, simulator.interface)) for r in drives]

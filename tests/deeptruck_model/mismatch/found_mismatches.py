"""A small drive, and what the tool would have found on it, for every verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from deeptruck_model.mismatch.data.checks import Rejection, SensorFault
from deeptruck_model.mismatch.data.prepared import prepare
from deeptruck_model.mismatch.finding import Finding
from deeptruck_model.mismatch.fit_result import Chosen, Compared, Errors, FitResult, Improvement, Rmse
from deeptruck_model.mismatch.mechanisms import LIBRARY, candidate_terms
from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.free_law import FreeModel
from deeptruck_model.mismatch.posterior.modelled import Formula
from deeptruck_model.mismatch.posterior.search import Model
from deeptruck_model.mismatch.report import findings
from deeptruck_model.mismatch.residual.evidence import Evidence, Stretch
from deeptruck_model.mismatch.residual.noise import Fit
from deeptruck_model.mismatch.result import (
    Bound,
    Conclusion,
    DataReport,
    Mismatch,
    Regime,
    Segment,
    SmallestVisible,
    Verdict,
)
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import TruckInterface

DT, BLOCK, MASS = 0.1, 2, 20000.0
VERDICTS = (
    "missing_physics",
    "unknown",
    "parameter_error",
    "measurement_fault",
    "nothing_missing",
    "undetermined",
)
PARAMETERS = ("mass", "drag_area")
DRIFTS = {"before": 1.0, "parameters_only": 0.7, "after": 0.2}  # m/s after a free run


def recording(k: int, seconds: float = 120.0) -> Recording:
    rng = np.random.default_rng(k)
    time = np.arange(round(seconds / DT)) * DT
    speed = 14.0 + 8.0 * np.sin(2 * np.pi * time / 50.0 + k) + rng.normal(0.0, 0.01, len(time))
    acceleration = 8.0 * 2 * np.pi / 50.0 * np.cos(2 * np.pi * time / 50.0 + k)
    channels = {
        "speed": speed,
        "acceleration": acceleration + rng.normal(0.0, 0.03, len(time)),
        "engine_command": np.clip(600.0 + 900.0 * acceleration, 0.0, 1900.0),
        "brake_command": np.clip(-25.0 * (acceleration + 0.3), 0.0, 100.0),
        "grade": 0.02 * np.sin(2 * np.pi * time / 80.0),
        "gear": np.clip(np.round(speed / 2.5), 1, 12),
    }
    return Recording(f"drive <{k}>", DT, channels, TruckInterface("test", "N m", "percent", fuel=False))


def evidence(prepared, force) -> Evidence:
    """Block means as the tool stacks them, with a residual of `force` (from the signals) and noise."""

    def stack(parts):
        return np.concatenate([p[: len(p) // BLOCK * BLOCK].reshape(-1, BLOCK).mean(axis=1) for p in parts])

    names = ("speed", "acceleration", "engine_command", "brake_command", "grade", "gear")
    signals = {n: stack([p.recording.channels[n] for p in prepared]) for n in names}
    signals["time"] = signals["elapsed"] = stack([p.recording.time for p in prepared])
    signals["simulated"] = signals["acceleration"]
    signals["engine"], signals["brake"] = signals["engine_command"] / 1500.0, signals["brake_command"] / 25.0
    signals["drag"], signals["rolling"] = 2e-4 * signals["speed"] ** 2, np.full_like(signals["speed"], 0.05)
    signals["distance"] = signals["place"] = np.cumsum(signals["speed"]) * DT * BLOCK
    size = len(signals["speed"]) // len(prepared)
    stretches = tuple(
        Stretch(p.recording.name, k * size, (k + 1) * size, 0.0, k >= len(prepared) - 2)
        for k, p in enumerate(prepared)
    )
    noise = np.random.default_rng(9).normal(0.0, 0.02, len(signals["speed"]))
    sensitivity = {"mass": signals["brake"] - signals["engine"], "drag_area": -signals["drag"]}
    return Evidence(
        DT * BLOCK, stretches, force(signals) + noise, signals["acceleration"], np.zeros(len(noise)),
        np.ones(len(noise), dtype=bool), signals, sensitivity, MASS,
        lambda name, amount: np.zeros(len(noise)),
    )  # fmt: skip


def model(named, e: Evidence, b, free, score: float) -> Model:
    blocks = [s.columns.shape[1] for s in named] + [1] * len(PARAMETERS)
    ends = np.cumsum([0, *blocks])
    names = [s.mechanism.effect for s in named] + [f"parameter:{p}" for p in PARAMETERS]
    layout = tuple((n, slice(int(a), int(z))) for n, a, z in zip(names, ends[:-1], ends[1:], strict=True))
    size = int(ends[-1])
    fit = Fit(
        np.resize(b, size), np.eye(size) * 1e-4, np.zeros(size), score, 0.02, np.zeros(5),
        np.zeros(len(e)), np.zeros(len(e)),
    )  # fmt: skip
    return Model(tuple(named), frozenset(free), fit, score, layout)


def errors(prepared, size: float) -> Errors:
    rng = np.random.default_rng(1)
    steps, windows = 400, 4
    drift = size * np.linspace(0.0, 1.0, steps) * rng.normal(1.0, 0.2, (windows, 1))
    return Errors(
        drift, rng.normal(0.0, 0.05, (windows, steps)), np.array([0, 0, 1, 1]), np.array([60, 600, 60, 600])
    )


FORCES = {
    "missing_physics": lambda s: -0.3 * s["brake"],
    "unknown": lambda s: 0.08 * np.sin(0.5 * s["speed"]),
    "parameter_error": lambda s: 0.1 * (s["brake"] - s["engine"]),
    "measurement_fault": lambda s: 0.0 * s["speed"],
    "nothing_missing": lambda s: 0.0 * s["speed"],
}


def mismatch(kind: str, count: int = 3) -> Mismatch:
    prepared = tuple(prepare(recording(k), True) for k in range(count))
    if kind == "undetermined":
        reason = "the speed is constant throughout: accelerate between 5 and 25 m/s"
        return Mismatch(
            Verdict(Conclusion.UNDETERMINED, data=DATA, caveats=(reason,)), None, None, {}, None, prepared
        )
    e = evidence(prepared, FORCES[kind])
    x, causes = explanation(kind, e)
    found = [findings.from_cause(c, e, x, {"mass": MASS, "drag_area": 6.0}) for c in causes]
    if kind == "measurement_fault":
        found.append(
            findings.from_sensor(
                SensorFault("acceleration_bias", 0.3, 0.01, "m/s^2", "it reads +0.300 m/s^2")
            )
        )
    if kind == "unknown":
        found[0] = findings.with_formula(
            found[0], Formula("1600 * sin(0.5 * speed)", 0.8, ("speed",)), e.unit
        )
    rows = [(s.start + 100, s.start + 250) for s in e.stretches]
    segments = tuple(
        Segment(s.name, 20.0, 50.0, 0, 1200.0, a, z, 5.0) for s, (a, z) in zip(e.stretches, rows, strict=True)
    )
    return Mismatch(
        replace(verdict(kind, found), segments=segments if causes else ()), e, x,
        {name: errors(prepared, size) for name, size in DRIFTS.items()},
        None, prepared,
    )  # fmt: skip


def explanation(kind: str, e: Evidence) -> tuple[Explanation, list[Cause]]:
    fade = candidate_terms(LIBRARY["brake_fade"], e)[0]
    named = [fade] if kind == "missing_physics" else []
    free = {"mass"} if kind == "parameter_error" else set()
    full = model(named, e, np.array([0.1]), free, 900.0)
    share = {"speed": 0.8, "grade": 0.12, "brake": 0.08}
    left = FreeModel(FORCES[kind](e.signals), 0.8 if kind == "unknown" else -0.01, share, {})
    rivals = (("dragging_brake", 3.0), ("mass", 40.0))
    causes = {
        "missing_physics": [
            Cause("missing_physics", "brake_fade", 90.0, 0.9, fade.columns[:, 0], fade, rivals)
        ],
        "unknown": [Cause("missing_physics", "unknown", 90.0, 0.9, left.prediction, nearest="headwind")],
        "parameter_error": [Cause("parameter_error", "mass", 90.0, 1.0, 0.1 * e.sensitivity["mass"])],
    }.get(kind, [])
    ranking = (
        ("brake_fade", 90.0),
        ("dragging_brake", 87.0),
        ("headwind", 14.0),
        ("turbo_lag", 2.0),
        ("load_slosh", -3.0),
    )
    x = Explanation(
        tuple(causes), full, model([], e, np.zeros(1), free, 810.0), model([], e, np.zeros(1), set(), 700.0),
        left, 60.0 if kind == "unknown" else 0.0, None,
        ranking if causes else (("headwind", 0.1), ("turbo_lag", -2.0)),
    )  # fmt: skip
    return x, causes


DATA = DataReport((Rejection("speed missing or invalid", 12),))
SEEN = SmallestVisible({"mass": 0.02}, 81.234 / 20000.0, 240.0 / 20000.0, 20000.0)


def fit(found: Sequence[Finding], **more: Any) -> FitResult:
    """A correction that helps, by all that was found; `more` are other values of it."""
    usual = FitResult(
        ("a",), 20.0, 4, Chosen.FINDINGS, tuple(f.effect for f in found), bool(found),
        Compared(Rmse(0.6, 0.05), Rmse(0.4, 0.05), Rmse(0.1, 0.05)), Improvement((0.5, 0.8), (0.1, 0.3), 1),
    )  # fmt: skip
    return replace(usual, **more)


def verdict(kind: str, found: Sequence[Finding]) -> Verdict:
    """The verdict with these findings."""
    return Verdict(
        Conclusion.PHYSICS if kind == "unknown" else Conclusion(kind),
        tuple(found),
        regimes=(Regime((Bound("brake", 0.3, np.inf, "m/s^2"),), 0.7, 0.1),),
        fit=fit(found),
        data=replace(DATA, smallest_visible=SEEN) if kind == "nothing_missing" else DATA,
    )

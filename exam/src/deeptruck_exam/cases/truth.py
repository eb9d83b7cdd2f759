"""The truth of a case: names, sizes, when the effects acted, and the information they left."""

from __future__ import annotations

from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam.cases.build import DT, MOTION_SD, Built, information
from deeptruck_exam.cases.levels import NOT_RECORDED
from deeptruck_exam.laws import Effect

LEAST = 0.03  # m/s2: below this nobody would say that an effect acts


def describe(built: Built, names: tuple[str, ...], simulator_values: dict[str, float]) -> dict[str, Any]:
    """The truth as plain data for JSON."""
    plan = built.plan
    first = plan.effects[0] if plan.effects and not plan.hidden_input else None
    leave_out = bool(plan.excluded)
    return {
        "schema": 1,
        "level": plan.level,
        "seed": plan.seed,
        "simulator": plan.simulator,
        "truck": plan.truck,
        "minutes": plan.minutes,
        "attempt": plan.attempt,
        "verdict": first.kind if first else "nothing_missing",
        "effects": []
        if plan.hidden_input
        else [
            _effect(e, s, leave_out, comparable(e, s, built))
            for e, s in zip(plan.effects, built.sizes, strict=True)
        ],
        "excluded": list(plan.excluded),
        "not_recorded": plan.hidden_input,
        "each_drive": plan.level == "each_drive_differs",
        "may_be_named": list(NOT_RECORDED[plan.hidden_input][1]) if plan.hidden_input else [],
        "condition": plan.condition,
        "drives": plan.drives,
        "styles": plan.styles,
        "information_nats": built.nats,
        "information_left_nats": built.nats_left,
        "information_nats_held_out": information(built.extra[plan.fit :], MOTION_SD),
        "rms_acceleration": float(np.sqrt(np.mean(seconds(built.extra) ** 2))),
        "segments": segments(built, names),
        "share_of_time": float(np.mean(acts(built.extra))),
        "nominal_parameters": {n: plan.values.get(n, 1.0) for n in PARAMETER_UNITS},
        "true_parameters": {n: built.oracle.parameters()[n] for n in PARAMETER_UNITS},
        "simulator_parameters": {n: simulator_values.get(n, 1.0) for n in PARAMETER_UNITS},
    }


PARAMETER_UNITS = {
    "mass": "kg",
    "drag_area": "m^2",
    "rolling_resistance": "1",
    "torque_gain": "1",
    "brake_gain": "1",
}


def _effect(
    effect: Effect, sizes: dict[str, float], leave_out: bool, sizes_of_one_meaning: dict[str, Any]
) -> dict[str, Any]:
    return {
        "key": effect.key,
        "name": "unknown" if leave_out else effect.name,
        "kind": effect.kind,
        "accepts": [] if leave_out else list(effect.accepts),
        "comparable": {} if leave_out else sizes_of_one_meaning,
        "sizes": sizes,
        "source": effect.source,
    }


def comparable(effect: Effect, sizes: dict[str, float], built: Built) -> dict[str, dict[str, Any]]:
    """Sizes whose meaning does not depend on the form of the law, {name: {value, unit}}. A scale is recorded
    over true, a bias recorded minus true; an offset or delay is positive if the channel or command is late.
    """
    sign, mass = float(np.sign(sizes.get("sign", 1.0))), built.truck.mass
    meanings: dict[str, tuple[str, float, str]] = {
        "network_delay": ("delay", sizes.get("delay_s", 0.0), "s"),
        "late_accelerometer": ("offset", sizes.get("late_s", 0.0) * sign, "s"),
        "late_responses": ("offset", sizes.get("late_s", 0.0), "s"),
        "tyre_factor": ("scale", 1.0 + sizes.get("scale", 0.0) * sign, "1"),
        "mounting_pitch": ("bias", sizes.get("bias", 0.0) * sign, "m/s^2"),
        "tilted_inclinometer": ("bias", sizes.get("bias", 0.0) * sign, "1"),
        "pitching_inclinometer": ("bias", sizes.get("bias", 0.0) * sign, "1"),
        "other_payload": ("mass", payload_share(sizes) * mass, "kg"),
        "heavy_flywheel": ("engine_inertia", sizes.get("engine_kgm2", 0.0), "kg m^2"),
        "damped_flywheel": ("engine_inertia", sizes.get("inertia", 0.0), "kg m^2"),
        "loose_tarpaulin": ("drag_area", sizes.get("gain", 0.0) * built.truck.drag_area, "m^2"),
    }
    if effect.kind == "parameter_error":
        true = built.oracle.parameters()[effect.name]
        return {effect.name: {"value": true, "unit": PARAMETER_UNITS[effect.name]}}
    if effect.key not in meanings:
        return {}
    name, value, unit = meanings[effect.key]
    return {name: {"value": value, "unit": unit}}


def payload_share(sizes: dict[str, float]) -> float:
    """Change of mass as a share, positive if loaded, from the effect's sizes."""
    return (1.0 if sizes.get("sign", 1.0) > -0.4 else -0.8) * sizes.get("share", 0.0)


def seconds(extra: Array) -> Array:
    """Running means of (batch, n) over one second."""
    return np.stack([np.convolve(row, np.ones(10) / 10.0, mode="same") for row in extra])


def acts(extra: Array) -> Array:
    """When the effects act: at least a quarter of their 98th percentile, and noticeable."""
    size = np.abs(seconds(extra))
    return np.asarray(size > max(LEAST, 0.25 * float(np.quantile(size, 0.98))))


def segments(built: Built, names: tuple[str, ...]) -> list[dict[str, Any]]:
    """Segments of at least a second in which the effects act, joined across pauses of up to two seconds."""
    active = acts(built.extra)
    mass = built.truck.mass
    out = []
    for row, name in enumerate(names):
        for start, end in _spans(active[row]):
            force = float(mass * built.extra[row, start:end].mean())
            out.append(
                {"recording": name, "start_s": start * DT, "end_s": end * DT, "mean_force_n": round(force, 1)}
            )
    return out


def _spans(active: Array) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], active.astype(int), [0]])))
    joined: list[tuple[int, int]] = []
    for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if joined and start - joined[-1][1] < 20:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((start, end))
    return [(start, end) for start, end in joined if end - start >= 10]

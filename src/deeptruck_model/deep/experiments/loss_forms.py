"""Why the two forms of the loss differ: what is fed back, and which setting of the recipe matters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from deeptruck_model.deep.arguments import PAPER_FUEL
from deeptruck_model.deep.experiments.beside_paper import VARIANTS
from deeptruck_model.deep.experiments.learning_curves import COLOURS, FED

Found = Mapping[tuple[str, str], list[dict[str, Any]]]
"""Figures of the measured seeds by truck and recipe."""

CAUSE = """### Why the deployment form stays above the training form

Mean squared errors over 10 s on an unseen hour, by which recorded responses are fed to the network in
place of its own. With 'nothing' it is the deployment form, with 'everything' the training form."""
CAUSE_HEAD = "| passes | recorded and fed back | acceleration (m/s²)² | speed (m/s)² | fuel rate (cm³/s)² |"
VARIED = {
    "short": "as it is",
    "slower": "a quarter of the step",
    "clipped": "gradients clipped to a norm of 1",
    "free": "trained in deployment form",
    "cubic": "fuel in cm³/s, losses too",
}
VARIED_SAYS = """
The recipe with one setting changed at a time, one seed each: medians of the losses over thirds of the
passes, and what the kept weights reach on the test drive.
""".strip()


def cause(found: Found) -> list[str]:
    """What is fed back in the deployment form, and what that costs, early and late; and the variants."""
    curves = [f["curves"] for f in found.get(("trucksim", "paper"), [])]
    looks = [[line for line in curve if "by_feedback" in line] for curve in curves]
    if not looks:
        return []
    lines = [CAUSE, "", CAUSE_HEAD, "|---|---|---|---|---|"]
    errors: dict[str, Any] = {}
    for k in sorted({0, len(looks[0]) // 2, len(looks[0]) - 1}):
        for fed in FED:
            errors[fed] = np.median([look[k]["by_feedback"][fed] for look in looks if k < len(look)], axis=0)
            cells = " | ".join(f"{x:.3g}" for x in errors[fed])
            lines.append(f"| {looks[0][k]['passes']:.0f} | {fed} | {cells} |")
    left = {fed: errors[fed][0] / errors["nothing"][0] for fed in ("speed", "acceleration", "fuel")}
    says = ", ".join(f"{fed} {100 * share:.0f} %" for fed, share in left.items())
    lines += [
        "",
        f"What is left of the acceleration's squared error at the end where one is recorded: {says}.",
        "",
    ]
    return [*lines, *_variants(found)]


def _variants(found: Found) -> list[str]:
    """Losses of the variants by thirds of their passes, and in which of them the deployment form rises."""
    seeds = {says: found[key][0] for name, says in VARIED.items() if found.get(key := ("trucksim", name))}
    if len(seeds) < 2:
        return []
    passes = [line["passes"] for line in next(iter(seeds.values()))["curves"]]
    thirds = np.array_split(np.arange(len(passes)), min(3, len(passes)))
    heads = [f"passes {passes[third[0]]:.0f} to {passes[third[-1]]:.0f}" for third in thirds]
    measured = "speed error, sd after 40 s (m/s) | runs within 1.5 m/s"
    lines = [
        VARIED_SAYS,
        "",
        f"| training form, deployment form | {' | '.join(heads)} | {measured} |",
        "|---" * (len(heads) + 3) + "|",
    ]
    rising = {}
    for says, seed in seeds.items():
        training, deployment = (
            [float(np.median([seed["curves"][k][form] for k in third])) for third in thirds]
            for form in COLOURS
        )
        cells = " | ".join(f"{t:.4f}, {d:.2f}" for t, d in zip(training, deployment, strict=True))
        within = f"{100 * seed['speed']['trials_within_1.5']:.0f} %"
        lines.append(f"| {says} | {cells} | {seed['speed']['sd_at_end']:.2f} | {within} |")
        rising[f"'{says}' (fuel is {_fuel_share(seed):.1%} of it)"] = deployment[-1] > deployment[-2:][0]
    rises, falls = ([says for says in rising if rising[says] is which] for which in (True, False))
    left = [says for says in VARIED.values() if says not in seeds]
    ends = [
        f"From the second third to the last the deployment form rises in: {', '.join(rises) or 'none'}.",
        f"It does not in: {', '.join(falls) or 'none'}.",
        *([f"Not run: {', '.join(left)}."] if left else []),
    ]
    return [*lines, "", *(line.replace("%", " %") for line in ends), ""]


def _fuel_share(seed: Mapping[str, Any]) -> float:
    """Share of fuel in the deployment form, at the last look at what is fed back."""
    last = [line["by_feedback"]["nothing"] for line in seed["curves"] if "by_feedback" in line][-1]
    variant = VARIANTS[str(seed["name"]).split("-")[1]]
    parts = np.array(last) * [1.0, 1.0, variant.fuel or PAPER_FUEL]
    return float(parts[-1] / parts.sum())

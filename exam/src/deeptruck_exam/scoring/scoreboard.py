"""Figures of merit over scored cases."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

Score = Mapping[str, Any]
ENOUGH_NATS, TOO_FEW_NATS = 100.0, 40.0


def by_level(results: Iterable[Score]) -> dict[tuple[str, str], dict[str, Any]]:
    """By (simulator, level): n and the rates of `rates`."""
    groups: dict[tuple[str, str], list[Score]] = {}
    for r in results:
        if "broken" not in r:
            groups.setdefault((r["simulator"], r["level"]), []).append(r)
    return {key: {"n": len(rows), **rates(rows)} for key, rows in groups.items()}


def mean(values: Iterable[Any]) -> float | None:
    known = [float(v) for v in values if v is not None]
    return float(np.mean(known)) if known else None


def rates(rows: Sequence[Score]) -> dict[str, float | None]:
    """Rates over the cases of one level; None if a figure does not apply there."""
    with_truth = [r for r in rows if r["true"]]
    nulls = [r for r in rows if not r["true"] and r["input_stated"] is None]
    intervals = [i["holds"] for r in rows for i in r["intervals"]]
    shares = [r["share"]["tool"] for r in rows if "tool" in r.get("share", {})]
    return {
        "right first": mean(r["right_first"] for r in with_truth),
        "in group": mean(r["in_group"] for r in with_truth),
        "set size": mean(r["set_size"] for r in with_truth),
        "log score": mean(r["log_score"] for r in with_truth),
        "recall": mean(r["recall"] for r in with_truth),
        "precision": mean(r["precision"] for r in with_truth),
        "silent": mean(r["outcome"] in ("silent", "undetermined") for r in rows),
        "false statement": mean(false_statement(r) for r in nulls),
        "unknown recognised": mean(r["recognised_unknown"] for r in rows),
        "input stated": mean(r["input_stated"] for r in rows),
        "each drive found": mean(r["each_drive_found"] for r in rows),
        "overlap": mean(r["overlap"] for r in with_truth),
        "intervals hold": mean(intervals),
        "share of oracle": float(np.median(shares)) if shares else None,
        "beats refit": mean(
            r["share"]["tool"] >= r["share"].get("parameters_only", 0.0)
            for r in rows
            if "tool" in r.get("share", {})
        ),
        "failed": mean(r["outcome"] == "failed" for r in rows),
    }


def false_statement(score: Score) -> bool:
    """Whether anything is stated although nothing is missing."""
    return bool(score["said"]) or score["verdict"] not in ("nothing_missing", "undetermined")


def rare_by_information(results: Iterable[Score]) -> dict[str, float | None]:
    """Results of level 'rare', split by the information in the recordings."""
    rows = [r for r in results if r.get("level") == "rare" and "broken" not in r]
    enough = [r for r in rows if r["information_nats"] > ENOUGH_NATS]
    few = [r for r in rows if r["information_nats"] < TOO_FEW_NATS]
    return {
        "enough, n": float(len(enough)),
        "enough, in group": mean(r["in_group"] for r in enough),
        "too little, n": float(len(few)),
        "too little, silent": mean(r["outcome"] in ("silent", "undetermined") for r in few),
    }


def confusion(results: Iterable[Score]) -> Counter[tuple[str, str]]:
    """Number of cases by (true effect, first stated effect), each 'nothing' if there is none.

    Broken cases and those with several true effects are omitted.
    """
    table: Counter[tuple[str, str]] = Counter()
    for r in results:
        if "broken" in r or len(r["true"]) > 1:
            continue
        true = r["true"][0] if r["true"] else "nothing"
        table[true, r["said"][0] if r["said"] else "nothing"] += 1
    return table

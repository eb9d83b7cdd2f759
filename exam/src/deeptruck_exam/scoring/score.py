"""Compares the withheld truth with the tool's verdict. All scoring rules are in this file.

Right first: the first finding has the true name. In the set: the true name is the first finding's or among
those that it states as not distinguishable. An equivalent name ('accepts' of an effect) counts only in the
group, and only if the tool also states the true name. A constant wrong mass is `mass`; a mass that differs
between drives is `payload_change`; the respective other name is wrong first, and right in the group when
stated. 'unknown' counts only as the finding's own name; among the alternatives it costs nothing.

If an input was withheld, the verdict must say so (`not_recorded`, or refuse with a line that names it), and
no finding may have a name that the input explains. If each drive differs, the largest part of the budget
except the unexplained one must be `each_drive`; without a budget, the first finding must name the difference.

The log score (Good, J. R. Stat. Soc. B 14, 1952) is the log probability that a verdict gives to the truth:
the probability of the first finding for its own name, the remainder in equal parts for the others of its
group, and a tenth of that for all names outside. A large group and an overconfident probability lower it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

Verdict = Mapping[str, Any]
NAMES = 33  # that a verdict can give, 'unknown' and 'nothing' among them
OUTSIDE = 0.1  # of the remaining probability: for the names outside its group
FAILED = "failed"
SILENT = 0.9  # the probability of nothing that a silent verdict states


def group(finding: Mapping[str, Any]) -> set[str]:
    """The finding's name and all names stated as not distinguishable from it."""
    others = finding.get("credible_set", finding.get("cannot_be_told_from"))  # schema 3, schema 2
    return {str(finding.get("effect")), *map(str, others or ())}


def bears(finding: Mapping[str, Any], name: str) -> bool:
    """Whether the finding has the name, or has it in its credible set."""
    return name == finding.get("effect") or (name != "unknown" and name in group(finding))


def probability_of(truth: str, findings: Sequence[Mapping[str, Any]]) -> float:
    """The probability that the first finding gives to the name; that of 'nothing' if there is no truth."""
    if not findings:
        return SILENT if truth == "nothing" else (1.0 - SILENT) / (NAMES - 1)
    first = findings[0]
    others = group(first) - {first.get("effect")}
    p = min(max(float(first.get("probability") or 0.5), 0.01), 0.99)
    if truth == first.get("effect"):
        return p
    if truth in others:
        return (1.0 - p) * (1.0 - OUTSIDE) / len(others)
    outside = OUTSIDE if others else 1.0
    return (1.0 - p) * outside / (NAMES - 1 - len(others))


def log_score(true: Sequence[str], findings: Sequence[Mapping[str, Any]]) -> float | None:
    """Log of `probability_of`, in nats; None where several effects are hidden."""
    return math.log(probability_of(true[0] if true else "nothing", findings)) if len(true) < 2 else None


def score_names(truth: Mapping[str, Any], verdict: Verdict) -> dict[str, Any]:
    """Names: outcome, right_first, in_group, set_size, log_score, recall, precision, kind_right."""
    findings = list(verdict.get("findings") or ())
    true = [str(e["name"]) for e in truth["effects"]]
    said = [str(f.get("effect")) for f in findings]
    result: dict[str, Any] = {
        "true": true,
        "keys": [e["key"] for e in truth["effects"]],
        "said": said,
        "verdict": verdict.get("verdict", FAILED),
        "outcome": _outcome(true, findings, verdict),
    }
    result["right_first"] = bool(true) and bool(said) and said[0] in true
    result["in_group"] = bool(true) and bool(findings) and any(bears(findings[0], t) for t in true)
    result["set_size"] = len(group(findings[0])) if true and findings else None
    result["log_score"] = log_score(true, findings)
    if true:
        result["kind_right"] = verdict.get("verdict") == truth["verdict"]
        result["recall"] = sum(any(bears(f, t) for f in findings) for t in true) / len(true)
        result["precision"] = (
            sum(any(bears(f, t) for t in true) for f in findings) / len(findings) if findings else None
        )
        result["false_names"] = [
            n for f, n in zip(findings, said, strict=True) if not any(bears(f, t) for t in true)
        ]
    return result


def _outcome(true: Sequence[str], findings: Sequence[Mapping[str, Any]], verdict: Verdict) -> str:
    """One word: failed, silent, undetermined, unknown, right, group, wrong, false_alarm."""
    if not verdict:
        return FAILED
    if not findings:
        return "undetermined" if verdict.get("verdict") == "undetermined" else "silent"
    if not true:
        return "false_alarm"
    if findings[0].get("effect") in true:
        return "right"
    if any(bears(findings[0], t) for t in true):
        return "group"
    return "unknown" if findings[0].get("effect") == "unknown" else "wrong"


def recognised_unknown(truth: Mapping[str, Any], verdict: Verdict) -> bool | None:
    """Whether a finding is 'unknown', if the truth has no name; else None."""
    if not any(e["name"] == "unknown" for e in truth["effects"]):
        return None
    return any(f.get("effect") == "unknown" for f in verdict.get("findings") or ())


def input_stated(truth: Mapping[str, Any], verdict: Verdict, says: str = "") -> bool | None:
    """Whether a withheld input is stated and no name is given that it explains. None if no input is
    withheld."""
    withheld = truth["not_recorded"]
    if not withheld:
        return None
    if not verdict:
        return withheld in says.lower()
    stated = any(entry.get("input") == withheld for entry in verdict.get("not_recorded") or ())
    named = {str(f.get("effect")) for f in verdict.get("findings") or ()}
    return stated and named <= {*truth["may_be_named"], "unknown"}


def each_drive_found(truth: Mapping[str, Any], verdict: Verdict) -> bool | None:
    """Whether a difference between drives is found as such. None if drives do not differ."""
    if not truth["each_drive"]:
        return None
    parts = {p["part"]: float(p["share"]) for p in (verdict.get("budget") or {}).get("parts") or ()}
    parts.pop("left_over", None)
    if parts:
        return max(parts, key=lambda part: parts[part]) == "each_drive"
    return bool(score_names(truth, verdict)["right_first"])


def overlap(truth: Mapping[str, Any], verdict: Verdict) -> float | None:
    """Time in both sets of segments over time in either; None if the truth has none."""
    true, found = _spans(truth["segments"]), _spans(verdict.get("segments") or ())
    if not true:
        return None
    both = sum(_common(true[name], found.get(name, [])) for name in true)
    either = sum(end - start for spans in (*true.values(), *found.values()) for start, end in spans) - both
    return both / either if either > 0.0 else 0.0


def score_events(truth: Mapping[str, Any], verdict: Verdict) -> dict[str, int]:
    """At level `rare`, how often the effect acted and how many of these times an event covers by half or
    more; and, at any level, the events that overlap nothing."""
    true, found = _spans(truth["segments"]), _spans(verdict.get("events") or ())
    rare = [(name, span) for name, spans in true.items() for span in spans if truth["level"] == "rare"]
    covered = [_common([span], found.get(name, [])) / (span[1] - span[0]) for name, span in rare]
    alone = [_common([span], true.get(name, [])) == 0.0 for name, spans in found.items() for span in spans]
    return {"true": len(rare), "located": sum(c >= 0.5 for c in covered), "false": sum(alone)}


Spans = list[tuple[float, float]]


def _spans(segments: Sequence[Mapping[str, Any]]) -> dict[str, Spans]:
    """For each recording the union of its segments."""
    raw: dict[str, Spans] = {}
    for s in segments:
        name = str(s["recording"]).split("#")[0]
        raw.setdefault(name, []).append((float(s["start_s"]), float(s["end_s"])))
    out: dict[str, Spans] = {}
    for name, spans in raw.items():
        union: Spans = []
        for start, end in sorted(spans):
            if union and start <= union[-1][1]:
                union[-1] = (union[-1][0], max(end, union[-1][1]))
            else:
                union.append((start, end))
        out[name] = union
    return out


def _common(left: Spans, right: Spans) -> float:
    return sum(max(0.0, min(b, d) - max(a, c)) for a, b in left for c, d in right)


def score_intervals(truth: Mapping[str, Any], verdict: Verdict) -> list[dict[str, Any]]:
    """For every true size that the tool states with an interval: truth, value, interval, and whether it
    contains the truth."""
    out = []
    for effect in truth["effects"]:
        for finding in verdict.get("findings") or ():
            if finding.get("effect") != effect["name"]:
                continue
            for name, true in effect["comparable"].items():
                stated = _stated(finding.get("parameters") or {}, name, true["unit"])
                if stated is None:
                    continue
                low, high = sorted(map(float, stated["ci95"]))
                out.append(
                    {
                        "effect": effect["name"],
                        "parameter": name,
                        "true": true["value"],
                        "value": stated.get("value"),
                        "ci95": [low, high],
                        "holds": low <= true["value"] <= high,
                    }
                )
    return out


def _stated(parameters: Mapping[str, Any], name: str, unit: str) -> Mapping[str, Any] | None:
    """The parameter of that name, else the only one of that unit; None without an interval or if several are
    possible."""
    known = {n: p for n, p in parameters.items() if p.get("ci95") and p.get("unit") == unit}
    if name in known:
        return dict(known[name])
    return dict(next(iter(known.values()))) if len(known) == 1 else None


def improvement(errors: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Improvement of the held-out open-loop speed error as a share of the oracle's, by competitor."""
    before, oracle = errors["before"]["speed_rmse"], errors["oracle"]["speed_rmse"]
    possible = before - oracle
    if possible <= 0.05 * before:
        return {}
    return {
        name: (before - e["speed_rmse"]) / possible
        for name, e in errors.items()
        if name not in ("before", "oracle")
    }

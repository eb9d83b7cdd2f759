"""Opens a sealed truth beside the tool's verdict and says what was right. All rules are in this file.

Right first: the first finding bears the true name. In the group: the true name is the first finding's or
among those it calls not distinguishable. An equivalent name ('accepts' of an effect) counts in the group
alone, and only where the tool itself states the true name beside it. A constant wrong mass is `mass`; a
mass that differs between drives is `payload_change`; the other name is wrong first, and right in the group
when stated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Verdict = Mapping[str, Any]


def group(finding: Mapping[str, Any]) -> set[str]:
    """The finding's name and all it is not distinguishable from."""
    return {str(finding.get("effect")), *map(str, finding.get("cannot_be_told_from") or ())}


def score_names(truth: Mapping[str, Any], verdict: Verdict) -> dict[str, Any]:
    """Names: outcome, right_first, in_group, recall, precision, kind_right."""
    findings = list(verdict.get("findings") or ())
    true = [str(e["name"]) for e in truth["effects"]]
    said = [str(f.get("effect")) for f in findings]
    result: dict[str, Any] = {
        "true": true,
        "keys": [e["key"] for e in truth["effects"]],
        "said": said,
        "verdict": verdict.get("verdict", "failed"),
        "outcome": _outcome(true, findings, verdict),
    }
    result["right_first"] = bool(true) and bool(said) and said[0] in true
    result["in_group"] = bool(true) and bool(findings) and bool(group(findings[0]) & set(true))
    if true:
        result["kind_right"] = verdict.get("verdict") == truth["verdict"]
        result["recall"] = sum(any(t in group(f) for f in findings) for t in true) / len(true)
        result["precision"] = (
            sum(bool(group(f) & set(true)) for f in findings) / len(findings) if findings else None
        )
        result["false_names"] = [n for f, n in zip(findings, said, strict=True) if not group(f) & set(true)]
    return result


def _outcome(true: Sequence[str], findings: Sequence[Mapping[str, Any]], verdict: Verdict) -> str:
    """One word: failed, silent, undetermined, unknown, right, group, wrong, false_alarm."""
    if not verdict:
        return "failed"
    if not findings:
        return "undetermined" if verdict.get("verdict") == "undetermined" else "silent"
    if not true:
        return "false_alarm"
    if findings[0].get("effect") in true:
        return "right"
    if group(findings[0]) & set(true):
        return "group"
    return "unknown" if findings[0].get("effect") == "unknown" else "wrong"


def recognised_unknown(truth: Mapping[str, Any], verdict: Verdict) -> bool | None:
    """Where the truth has no name: whether 'unknown' was said, alone or beside a nearest name. None
    elsewhere."""
    if not any(e["name"] == "unknown" for e in truth["effects"]):
        return None
    return any("unknown" in group(f) for f in verdict.get("findings") or ())


def overlap(truth: Mapping[str, Any], verdict: Verdict) -> float | None:
    """Time in both sets of segments over time in either; None where the truth has none."""
    true, found = _spans(truth["segments"]), _spans(verdict.get("segments") or ())
    if not true:
        return None
    both = sum(_common(true[name], found.get(name, [])) for name in true)
    either = sum(_length(spans) for spans in (*true.values(), *found.values())) - both
    return both / either if either > 0.0 else 0.0


Spans = list[tuple[float, float]]


def _spans(segments: Sequence[Mapping[str, Any]]) -> dict[str, Spans]:
    """Per recording the union of its segments."""
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


def _length(spans: Spans) -> float:
    return sum(end - start for start, end in spans)


def _common(left: Spans, right: Spans) -> float:
    return sum(max(0.0, min(b, d) - max(a, c)) for a, b in left for c, d in right)


def score_intervals(truth: Mapping[str, Any], verdict: Verdict) -> list[dict[str, Any]]:
    """For every true size that the tool states with an interval: truth, value, interval, whether it holds."""
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
    """The parameter of that name, else the only one of that unit; None without an interval or where several
    could be meant."""
    known = {n: p for n, p in parameters.items() if p.get("ci95") and p.get("unit") == unit}
    if name in known:
        return dict(known[name])
    return dict(next(iter(known.values()))) if len(known) == 1 else None


def improvement(errors: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Shares of the oracle's improvement of the held-out open-loop speed error, per competitor."""
    before, oracle = errors["before"]["speed_rmse"], errors["oracle"]["speed_rmse"]
    possible = before - oracle
    if possible <= 0.05 * before:
        return {}
    return {
        name: (before - e["speed_rmse"]) / possible
        for name, e in errors.items()
        if name not in ("before", "oracle")
    }

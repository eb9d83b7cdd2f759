"""Pool the verdicts of a fleet: pool.json, from the receipts of `compare`, and series.json: the trucks
discovered in repeated runs, as new drives arrive.

Testing a fleet every week is multiple testing. Each run is a batch of the tested trucks that have new drives
and were not discovered before. Its level follows Zrnic, Jiang, Ramdas and Jordan (The power of batching in
multiple hypothesis testing, AISTATS 2020, for batches of positively dependent p-values), so that on average
at most the stated share of all discoveries in the series is false.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from deeptruck_model.fleet.compare import PREVIOUS, VERDICT, VERDICTS, folder, receipts
from deeptruck_model.fleet.plan import Truck
from deeptruck_model.fleet.statistics import (
    REFERENCE,
    TESTED,
    Seen,
    Tested,
    discovered,
    least_references,
    level_of_batch,
    pooled,
    share,
    siblings,
    total,
)
from deeptruck_model.fleet.storage import Place
from deeptruck_model.mismatch.mechanisms.families import FAMILY

POOLED, SERIES = "pool.json", "series.json"
Z95 = 1.96
COMMON = 0.5  # of the trucks of a class: a family that more have is a fault of the simulator
NAMED = 6  # trucks that a headline names; more are counted
OF_A_PLACE = "distance along the road"  # what a size depends on that is not of the truck


def pool(target: Place, trucks: Mapping[str, Truck], level: float) -> dict[str, Any]:
    """Write pool.json and return its content. Raises InputError if no truck was compared."""
    there, every = {f.path for f in target.list(VERDICTS)}, receipts(target)
    compared = {r["truck"]: r for r in every if "quarantined" not in r}
    verdicts = {truck: target.read_json(f"{folder(truck)}/{VERDICT}") for truck in compared}
    previous = {t: target.read_json(p) for t in compared if (p := f"{folder(t)}/{PREVIOUS}") in there}
    kinds: dict[str, list[str]] = {}
    for name in sorted(compared):
        kinds.setdefault(_of(trucks, name).kind, []).append(name)
    entries: dict[str, Any] = {}
    classes = {}
    for kind, names in sorted(kinds.items()):
        seen = {
            n: Seen(
                compared[n]["nats_fitted"],
                compared[n]["nats_held_out"],
                compared[n]["hours_held_out"],
                _of(trucks, n).sound,
            )
            for n in names
        }
        tested = siblings(seen, FAMILY, level)
        for n in names:
            entries[n] = _entry(kind, tested[n], compared[n], verdicts[n], _of(trucks, n))
            if n in previous:
                entries[n]["previous"] = _result(previous[n], previous[n][VERDICT])
        classes[kind] = _class(tested, [verdicts[n] for n in names], level)
    out = {
        "level": level,
        "classes": classes,
        "trucks": dict(sorted(entries.items())),
        "quarantined": {r["truck"]: r["quarantined"] for r in every if "quarantined" in r},
        "without_drives": sorted(trucks.keys() - {r["truck"] for r in every}),
        "effects": _effects(entries),
        "sizes": _sizes({n: (entries[n]["class"], verdicts[n]) for n in entries}),
        "series": advance(
            target, {n: e["p"] for n, e in entries.items() if e["role"] == TESTED}, compared, level
        ),
    }
    target.write_json(POOLED, out)
    return out


def headline(pooled: Mapping[str, Any]) -> tuple[str, str]:
    """Two sentences, without full stops: the main result among the trucks, and what of it is statistically
    established."""
    entries, level = pooled["trucks"], f"{pooled['level']:g}"
    tested, references = (
        {n: e for n, e in entries.items() if e["role"] == role} for role in (TESTED, REFERENCE)
    )
    differ = [n for n, e in entries.items() if e["differs"]]
    if tested:
        first = f"of {len(entries)} trucks {_named(tested)} stand{'s' * (len(tested) == 1)} out"
        first += _nats(tested, " by {} nats of held-out evidence")
        first += _nats(references, ", their siblings have {}")
    else:
        first = f"none of {len(entries)} trucks differs from its siblings"
    if differ:
        return first, f"established to differ, at a false discovery rate of {level}: {_named(differ)}"
    classes = [c for c in pooled["classes"].values() if c["tested"]]  # so that all could be discovered
    needed = max((int(c["references_needed"].get(str(c["tested"]), 0)) for c in classes), default=0)
    takes = f", which takes {needed} references in a class" if needed else ""
    return first, f"none is established to differ{takes}"


def _named(names: Iterable[str]) -> str:
    """Names of a few trucks; the number of more."""
    names = list(names)
    return ", ".join(names) if len(names) <= NAMED else str(len(names))


def _nats(entries: Mapping[str, Mapping[str, Any]], text: str) -> str:
    """The range of held-out evidence as text; empty if none is known."""
    known = sorted(e["held_out"] for e in entries.values() if e["held_out"] is not None)
    if not known:
        return ""
    low, high = f"{known[0]:.0f}", f"{known[-1]:.0f}"
    return text.format(low if low == high else f"{low} to {high}")


def _of(trucks: Mapping[str, Truck], name: str) -> Truck:
    return trucks.get(name, Truck(name))


def _entry(
    kind: str, tested: Tested, receipt: Mapping[str, Any], verdict: Mapping[str, Any], truck: Truck
) -> dict[str, Any]:
    return {
        "class": kind,
        "traits": dict(truck.traits),
        **{n: v if not isinstance(v, float) or np.isfinite(v) else None for n, v in asdict(tested).items()},
        **_result(receipt, verdict),
        "families_nats": {
            family: round(total(nats, [n for n in nats if FAMILY.get(n, n) == family]), 3)
            for nats in [receipt["nats_held_out"]]
            for family in sorted({FAMILY.get(name, name) for name in nats})
        },
        "tree": {n["node"]: n["probability"] for n in verdict["tree"] if n["parent"] == "mismatch"},
        "weeks": receipt["weeks"],
    }


def _result(receipt: Mapping[str, Any], verdict: Mapping[str, Any]) -> dict[str, Any]:
    """Summary of a verdict: statement, hours, last week, and held-out evidence, nats."""
    nats = total(receipt["nats_held_out"])
    return {
        "verdict": verdict["verdict"],
        "stated": [f["stated"] for f in verdict["findings"]],
        "hours": round(receipt["hours_fitted"] + receipt["hours_held_out"], 3),
        "last_week": max(receipt["weeks"], default=None),
        "held_out": nats if np.isfinite(nats) else None,
    }


def _class(
    tested: Mapping[str, Tested], verdicts: Iterable[Mapping[str, Any]], level: float
) -> dict[str, Any]:
    """Effects that can be found in a class, and those that all of its trucks share."""
    references = sum(t.role == REFERENCE for t in tested.values())
    candidates = sum(t.role == TESTED for t in tested.values())
    found = sum(t.differs for t in tested.values())
    families = Counter(f for v in verdicts for f in sorted({x["family"] for x in v["findings"]}))
    needed = {k: least_references(candidates, k, level) for k in {1, candidates} if k}
    return {
        "trucks": len(tested),
        "references": references,
        "tested": candidates,
        "differ": found,
        "left_out": dict(Counter(t.role for t in tested.values() if t.role not in (REFERENCE, TESTED))),
        "smallest_p": round(1.0 / (references + 1), 5),
        "references_needed": {str(k): n for k, n in sorted(needed.items())},
        "common": {
            f: round(n / len(tested), 3) for f, n in families.items() if n > max(1, COMMON * len(tested))
        },
    }


def _effects(entries: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The share of trucks that differ, over all and by each value of each trait, with 95 % intervals; and the
    statements on these trucks."""
    groups: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for e in entries.values():
        for group in (("all", "all"), ("class", e["class"]), *e["traits"].items()):
            groups.setdefault(group, []).append(e)
    out = []
    for (trait, value), members in sorted(groups.items()):
        judged = [e for e in members if e["role"] in (REFERENCE, TESTED)]
        if not judged:
            continue
        differ = [e for e in judged if e["differs"]]
        low_high = share(len(differ), len(judged))
        stated = Counter(s for e in differ for s in dict.fromkeys(e["stated"]))
        out.append(
            {
                "trait": trait,
                "value": value,
                "trucks": len(judged),
                "differ": len(differ),
                "share": [round(x, 4) for x in low_high],
                "stated": dict(stated.most_common()),
            }
        )
    return out


def _sizes(verdicts: Mapping[str, tuple[str, Mapping[str, Any]]]) -> list[dict[str, Any]]:
    """Sizes of findings that several trucks of a class share, raw and shrunk; sizes along a road apply to
    that road only."""
    found: dict[tuple[str, str, str, str], dict[str, tuple[float, float]]] = {}
    for truck, (kind, verdict) in verdicts.items():
        for f in verdict["findings"]:
            if OF_A_PLACE in f["depends_on"]:
                continue
            for name, size in f["parameters"].items():
                if size["ci95"]:
                    sd = (size["ci95"][1] - size["ci95"][0]) / (2.0 * Z95)
                    if sd > 0.0:
                        where = (kind, f["effect"], name, size["unit"])
                        found.setdefault(where, {})[truck] = (size["value"], sd)
    out = []
    for (kind, effect, name, unit), by_truck in sorted(found.items()):
        if len(by_truck) < 2:
            continue
        values, sds = zip(*by_truck.values(), strict=True)
        of = pooled(values, sds)
        rows = {
            truck: {"raw": float(f"{raw:.5g}"), "shrunk": float(f"{shrunk:.5g}")}
            for truck, raw, shrunk in zip(by_truck, of.raw, of.shrunk, strict=True)
        }
        out.append(
            {
                "class": kind,
                "effect": effect,
                "size": name,
                "unit": unit,
                "mean": float(f"{of.mean:.5g}"),
                "ci95": [float(f"{of.mean + s * Z95 * of.error:.5g}") for s in (-1.0, 1.0)],
                "sd_between": float(f"{of.between:.5g}"),
                "trucks": rows,
            }
        )
    return out


def advance(
    target: Place, p: Mapping[str, float], receipts: Mapping[str, Mapping[str, Any]], level: float
) -> list[dict[str, Any]]:
    """The batches of the present series, the new one last. `p` are the p-values of the tested trucks,
    `receipts` those of `compare`. Nothing is tested without new drives; another simulator or level begins a
    new series, and earlier series are kept."""
    kept = target.read_json(SERIES)["series"] if target.exists(SERIES) else []
    named = {"level": level, "simulators": sorted({r["simulator"] for r in receipts.values()})}
    own = next((s for s in kept if {name: s[name] for name in named} == named), None)
    batches: list[dict[str, Any]] = own["batches"] if own is not None else []
    known = {truck for b in batches for truck in b["discovered"]}
    compared = {truck: b["compared"][truck] for b in batches for truck in b["compared"]}
    new = [t for t in p if t not in known and compared.get(t) != receipts[t]["key"]]
    if not new:
        return batches
    at = level_of_batch(level, len(batches) + 1, len(new), len(known))
    found = discovered([p[t] for t in new], at)
    batch = {
        "until": max((w for t in new for w in receipts[t]["weeks"]), default=None),
        "level": at,
        "p": {t: p[t] for t in new},
        "compared": {t: receipts[t]["key"] for t in new},
        "discovered": [t for t, yes in zip(new, found, strict=True) if yes],
    }
    batches = [*batches, batch]
    series = [s for s in kept if s is not own] + [named | {"batches": batches}]
    target.write_json(SERIES, {"series": series})
    return batches

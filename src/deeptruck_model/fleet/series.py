"""series.json: the trucks discovered in repeated runs of `pool`, as new drives arrive.

Testing a fleet every week is multiple testing. Each run is a batch of the tested trucks that have new drives
and were not discovered before. Its level follows Zrnic, Jiang, Ramdas and Jordan (The power of batching in
multiple hypothesis testing, AISTATS 2020, for batches of positively dependent p-values), so that on average
at most the stated share of all discoveries in the series is false.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from deeptruck_model.fleet.statistics import discovered, level_of_batch
from deeptruck_model.fleet.storage import Place

SERIES = "series.json"


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

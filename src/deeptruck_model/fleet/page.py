"""The page of a fleet, or of any folder of verdicts: trucks by families and by weeks. It decides nothing."""

from __future__ import annotations

import math
import posixpath
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, StrictUndefined
from pyarrow import fs

from deeptruck_core import files, pages
from deeptruck_core.errors import InputError
from deeptruck_model.fleet.compare import VERDICT, folder
from deeptruck_model.fleet.extract import INDEX
from deeptruck_model.fleet.pool import POOLED, headline
from deeptruck_model.fleet.roads import MERGED, NUMBERS, ROADS, TABLE, road_map, said
from deeptruck_model.fleet.storage import Place
from deeptruck_model.mismatch.mechanisms.families import NAMES, UNKNOWN
from deeptruck_model.mismatch.verdict.wording import opened, spoken

PAGE = "fleet.html"
MARK = '<meta name="generator" content="deeptruck-model fleet show">'
FAMILIES = (*NAMES, UNKNOWN)
FULL_NATS = 100.0  # of evidence, at which a cell is darkest; the shade is logarithmic
FIRST = 20  # trucks that are listed to be looked at first
NOTHING = ("nothing_missing", "undetermined")


def show(target: Place) -> str:
    """Write fleet.html into a fleet's result, or into a folder of verdicts, and return its path. Raises
    InputError if there is no result, or if a file of that name was not written by this command."""
    content = _fleet(target) if target.exists(POOLED) else _folder(target)
    if target.exists(PAGE) and MARK.encode() not in target.read(PAGE):
        raise InputError(f"{target.name}/{PAGE} was not written by 'fleet show'; rename it")
    if isinstance(target.files, fs.LocalFileSystem):
        files.check_outside(Path(target.at(PAGE)))
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = resources.files(__package__).joinpath("fleet.html.jinja").read_text(encoding="utf-8")
    style = pages.shared(pages.STYLE, pages.DOCUMENT, pages.DARK)
    page = environment.from_string(template).render(
        style=style, mark=MARK, families=[opened(spoken(f)) for f in FAMILIES], **content
    )
    target.write(PAGE, page.encode())
    return f"{target.name}/{PAGE}"


def _fleet(target: Place) -> dict[str, Any]:
    pooled, index = target.read_json(POOLED), target.read_json(INDEX)
    trucks = sorted(pooled["trucks"].items(), key=lambda item: -_number(item[1]["held_out"]))
    rows = [
        {
            "name": name,
            "link": _link(posixpath.join(folder(name), "report.html")),
            "cells": [_nats(e["families_nats"].get(f), f in (e["families"] or {})) for f in FAMILIES],
            "marked": e["differs"],
        }
        for name, e in trucks
    ]
    stands_out, established = headline(pooled)
    total, out = index["total"], index["quarantined"] | index["failed"]
    first = [_first(name, e) for name, e in trucks if e["role"] == "tested"][:FIRST]
    return {
        "title": opened(stands_out),
        "says": [
            f"{opened(established)}.",
            f"{total['hours']:.1f} h of driving in {total['files']} files; {len(out)} files and "
            f"{len(pooled['quarantined'])} trucks left out.",
            *(_of_class(kind, c, pooled["level"]) for kind, c in pooled["classes"].items()),
        ],
        "first": first,
        "again": _again(pooled["trucks"]),
        "series": [
            (b["until"] or "", str(len(b["p"])), f"{b['level']:.3g}", ", ".join(b["discovered"]) or "none")
            for b in pooled.get("series", ())
        ],
        "roads": _roads(target),
        "rows": rows,
        "legend": "Evidence for each family on drives held out, in nats; ● is a discovery within its truck.",
        "weeks": _weeks(trucks),
        "effects": [_effect(e) for e in pooled["effects"]],
        "sizes": [_size(s, truck, v) for s in pooled["sizes"] for truck, v in s["trucks"].items()],
        "left_out": [*out.items(), *pooled["quarantined"].items()],
    }


def _folder(target: Place) -> dict[str, Any]:
    """The findings of all verdicts below a folder, and their tree."""
    listed = [f.path for f in target.list()]
    found = {posixpath.dirname(p): target.read_json(p) for p in listed if posixpath.basename(p) == VERDICT}
    if not found:
        raise InputError(
            f"{target.name} has no verdicts; give the folder that 'fleet' or 'mismatch' wrote into"
        )
    there = set(listed)
    rows, first = [], []
    for name, verdict in sorted(found.items(), key=lambda item: (item[1].get("verdict") in NOTHING, item[0])):
        try:
            tree = {n["node"]: n["probability"] for n in verdict["tree"] if n["parent"] == "mismatch"}
            stated = [f["stated"] for f in verdict["findings"]]
            said = str(verdict["verdict"])
        except (KeyError, TypeError):
            raise InputError(f"{target.name}/{name}/{VERDICT} is no verdict of this tool") from None
        report = posixpath.join(name, "report.html")
        link = _link(report) if report in there else None
        marked = said not in NOTHING
        probabilities = [tree.get(f, 0.0) if marked else 0.0 for f in FAMILIES]
        cells = [
            {"text": f"{100 * p:.0f}" if p >= 0.005 else "", "shade": f"{0.75 * p:.2f}"}
            for p in probabilities
        ]
        label = name or target.name
        rows.append({"name": label, "link": link, "cells": cells, "marked": marked})
        if marked:
            first.append((label, link, said.replace("_", " "), _stated(stated), "", ""))
    return {
        "title": f"{sum(bool(r['marked']) for r in rows)} of {len(rows)} results have a finding",
        "says": [
            "Each verdict by itself: whether trucks differ from their siblings is said by 'fleet pool'."
        ],
        "first": first[:FIRST],
        "again": None,
        "series": [],
        "roads": None,
        "rows": rows,
        "legend": "Probability of each family, in percent, where there is a finding.",
        "weeks": None,
        "effects": [],
        "sizes": [],
        "left_out": [],
    }


def _of_class(kind: str, c: Mapping[str, Any], level: float) -> str:
    text = (
        f"Class {kind}: {c['tested']} trucks tested against {c['references']} references at a false "
        f"discovery rate of {level:g}; the smallest possible p is {c['smallest_p']:.2g}."
    )
    if c["tested"] and not c["differ"]:
        needed = c["references_needed"][str(c["tested"])]
        text += f" All tested trucks together could be discoveries with {needed} references or more."
    if c["common"]:
        text += f" Shared by most, so an error of the simulator: {', '.join(map(spoken, c['common']))}."
    if c["left_out"]:
        text += " Not judged: " + ", ".join(f"{n} ({why})" for why, n in c["left_out"].items()) + "."
    return text


def _first(name: str, e: Mapping[str, Any]) -> tuple[str, str, str, str, str, str]:
    link = _link(posixpath.join(folder(name), "report.html"))
    verdict = "differs" if e["differs"] else "not established"
    stated = _stated(e["stated"]) or e["verdict"].replace("_", " ")
    return (name, link, verdict, stated, f"{_number(e['held_out']):.1f}", f"{e['q']:.3g}")


def _again(trucks: Mapping[str, Any]) -> dict[str, Any] | None:
    """Trucks that were compared again: their number, and the earlier and present results that differ."""
    again = {name: e for name, e in trucks.items() if "previous" in e}
    if not again:
        return None
    changed = {n: e for n, e in again.items() if _says(e) != _says(e["previous"])}
    rows = [
        {
            "name": n,
            "link": _link(posixpath.join(folder(n), "report.html")),
            "results": [_short(e["previous"]), _short(e)],
        }
        for n, e in changed.items()
    ]
    return {"count": len(again), "rows": rows}


def _roads(target: Place) -> dict[str, Any] | None:
    """Sentence and map of the shared roads; None before the stage was run."""
    if not target.exists(ROADS):
        return None
    found = target.read_json(ROADS)
    drawn = road_map(target.read_table(TABLE, MERGED, NUMBERS)) if found["km"] else None
    return {"says": said(found), "map": drawn}


def _says(result: Mapping[str, Any]) -> tuple[str, list[str]]:
    return result["verdict"], sorted(result["stated"])


def _short(result: Mapping[str, Any]) -> tuple[str, str, str]:
    """Short result, hours of driving, and evidence, as text."""
    said = result["verdict"].replace("_", " ")
    said += f": {_stated(result['stated'])}" if result["stated"] else ""
    until = f" until {result['last_week']}" if result["last_week"] else ""
    return said, f"{result['hours']:.1f} h{until}", f"{_number(result['held_out']):.1f}"


def _stated(stated: list[str]) -> str:
    return ", ".join("no name is probable enough" if s == "mismatch" else spoken(s) for s in stated)


def _nats(value: float | None, marked: bool) -> dict[str, str]:
    """Text and darkness (0 to 1) of a table cell."""
    if value is None:
        return {"text": "", "shade": "0"}

    shade = math.log1p(max(value, 0.0)) / math.log1p(FULL_NATS)
    return {"text": f"{value:.0f}{' ●' if marked else ''}", "shade": f"{min(shade, 1.0) * 0.75:.2f}"}


def _weeks(trucks: list[tuple[str, Any]]) -> dict[str, Any] | None:
    """Residual rms by truck and week; None without dates."""
    weeks = sorted({w for _, e in trucks for w in e["weeks"]})
    if not weeks:
        return None
    most = max(v for _, e in trucks for v in e["weeks"].values()) or 1.0
    rows = [
        {
            "name": name,
            "link": _link(posixpath.join(folder(name), "report.html")),
            "cells": [
                {"text": f"{1000 * e['weeks'][w]:.0f}", "shade": f"{0.75 * e['weeks'][w] / most:.2f}"}
                if w in e["weeks"]
                else {"text": "", "shade": "0"}
                for w in weeks
            ],
            "marked": e["differs"],
        }
        for name, e in trucks
    ]
    return {"head": weeks, "rows": rows}


def _effect(e: Mapping[str, Any]) -> tuple[str, ...]:
    share, low, high = (f"{100 * x:.0f}" for x in e["share"])
    group = "all trucks" if e["trait"] == "all" else f"{e['trait']}: {e['value']}"
    stated = ", ".join(f"{spoken(s)} {n}" for s, n in e["stated"].items() if s != "mismatch")
    return group, f"{e['differ']} of {e['trucks']}", f"{share} % ({low} to {high})", stated


def _size(s: Mapping[str, Any], truck: str, v: Mapping[str, float]) -> tuple[str, ...]:
    low, high = s["ci95"]
    what = f"{spoken(s['effect'])}, {s['size'].replace('_', ' ')}"
    return (
        what,
        truck,
        f"{v['raw']:.3g}",
        f"{v['shrunk']:.3g}",
        f"{s['mean']:.3g} ({low:.3g} to {high:.3g}) {s['unit']}",
    )


def _number(value: float | None) -> float:
    return -1e9 if value is None else value


def _link(path: str) -> str:
    return quote(path)

"""Writes the tables of pages that the source has, between their marks `<!-- NAME: begin -->` and
`<!-- NAME: end -->`, and j1939_signals.csv: `make schemas`, after the schemas.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

from deeptruck_core.signals import CHANNELS
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.families import PARAMETER_ERRORS, SENSOR_ERRORS
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.recordings.not_recorded import INPUTS
from deeptruck_model.recordings.units import canonical_units
from deeptruck_nodes import parameters
from deeptruck_nodes.topics import TOPICS, Topic
from truck_bridge.j1939.codec import Layout, Signal, load

HERE = Path(__file__).parent
SIGNALS = "message,PGN,period,signal,SPN,position,bits,unit,resolution,offset,lowest,highest"
Schema = dict[str, Any]


def tables() -> dict[tuple[str, str], str]:
    """Every table by its page and mark."""
    columns, topics, vehicle = map(schema, ("columns", "topics", "vehicle"))
    fuel = columns["properties"]["channels"]["properties"]["fuel_rate"]  # its entry has every key but `part`
    both = fuel["properties"] | topics["properties"]["engine_command"]["properties"]
    return {
        ("mismatch_rules.md", "rules"): table("rule | value | unit | means | source", rule_rows()),
        ("mismatch_effects.md", "effects"): table(
            "effect | family | equation | needs | source | would be separated by", effect_rows()
        ),
        ("topics.md", "topics"): table("topic | type | rate | content", map(topic_row, TOPICS.values())),
        ("parameters.md", "parameters"): "\n\n".join(map(node_section, parameters.schema())),
        ("columns.md", "keys"): table("key | means", described(columns["properties"])),
        ("columns.md", "entries"): table("key | means", described(both)),
        ("columns.md", "channels"): table("channel | unit | range | means", map(channel_row, CHANNELS)),
        ("columns.md", "not_recorded"): table(
            "input | without it | record", (f"{one.name} | {one.hides} | {one.signal}" for one in INPUTS)
        ),
        ("vehicle_file.md", "keys"): table("key | takes | means", vehicle_rows(vehicle)),
    }


def schema(name: str) -> Schema:
    """The JSON Schema of a kind of file, as editors get it."""
    found: Schema = json.loads((HERE / "schemas" / f"{name}.schema.json").read_text(encoding="utf-8"))
    return found


def table(heads: str, rows: Iterable[str]) -> str:
    """A Markdown table of rows that are written as `a | b | c`."""
    rule = " | ".join("---" for _ in heads.split(" | "))
    return "\n".join(f"| {row} |" for row in (heads, rule, *rows))


def rule_rows() -> Iterator[str]:
    """The rules of the mismatch tool with their values."""
    for rule in fields(Rules):
        value = rule.default if isinstance(rule.default, tuple) else (rule.default,)
        numbers, of = ", ".join(f"{x:g}" for x in value), rule.metadata
        yield f"`{rule.name}` | {numbers} | {of['unit']} | {of['means']} | {of['source']}"


def effect_rows() -> Iterator[str]:
    """Every name that a finding can have: mechanisms, sensor faults, parameters, unknown."""
    for m in LIBRARY.values():
        name = f"`{m.effect}`{' (measurement)' * (m.kind == 'measurement_fault')}"
        yield row(name, m.family, m.equation, ", ".join(m.needs), m.source, m.manoeuvre)
    for f in SENSOR_ERRORS.values():
        how = (f.needs, "kinematics", "move the truck by a known distance")
        yield row(f"`{f.name}` (measurement)", f.family, f.equation, *how)
    for p in PARAMETER_ERRORS.values():
        how = ("engine, brake, speed", "definition", p.manoeuvre)
        yield row(f"`{p.name}` (parameter)", p.family, f"{p.says}; {p.unit}", *how)
    yield row("`unknown`", "", "F follows none of these", "any", "", "vary one signal alone")


def row(*cells: str) -> str:
    """Cells in which a bar is no border."""
    return " | ".join(cell.replace("|", "\\|") for cell in cells)


def topic_row(topic: Topic) -> str:
    """A topic; who publishes and receives it is said with the nodes."""
    names = ", ".join(topic.fields)
    content = f"{topic.content}: {names}" if names else topic.content
    return f"`{topic.name}` | {topic.type_name} | {topic.rate} | {content}"


def node_section(node: str) -> str:
    """The topics and parameters of a node."""
    ends = (("Receives", "subscribers"), ("Publishes", "publishers"))
    said = ((what, [f"`{t.name}`" for t in TOPICS.values() if node in getattr(t, end)]) for what, end in ends)
    rows = (
        f"`{name}` | {json.dumps(one['default'])} | {'..'.join(f'{x:g}' for x in one.get('range', ()))} | "
        f"{one['says']}"
        for name, one in parameters.schema()[node].items()
    )
    topics = " ".join(f"{what} {', '.join(names)}." for what, names in said if names)
    return "\n\n".join(
        filter(None, (f"## {node}", topics, table("parameter | default | range | means", rows)))
    )


def described(properties: Schema) -> Iterator[str]:
    """The keys of a mapping, with what the schema says of them."""
    return (f"`{key}` | {entry['description']}" for key, entry in properties.items())


def channel_row(name: str) -> str:
    """A channel, with the units that it is kept in."""
    one = CHANNELS[name]
    return f"`{name}` | {', '.join(canonical_units(name))} | {one.low:g} to {one.high:g} | {one.meaning}"


def vehicle_rows(of: Schema, place: str = "") -> Iterator[str]:
    """The keys below a part of the schema of vehicle files that say what they mean."""
    for key, entry in of["properties"].items():
        if "description" not in entry:
            continue
        inner, where = entry, place + key
        while isinstance(inner.get("additionalProperties"), dict):
            inner, where = inner["additionalProperties"], f"{where}.NAME"
        needed = "" if key in of.get("required", ()) else ", optional"
        yield f"`{where}` | {takes(inner)}{needed} | {entry['description']}"
        if "properties" in inner:
            yield from vehicle_rows(inner, f"{where}.")


def takes(entry: Schema) -> str:
    """The values of a key of a vehicle file, in words."""
    if "enum" in entry:
        return ", ".join(map(str, entry["enum"]))
    if entry["type"] == "array":
        return f"list: {takes(entry['items'])}"
    if entry["type"] == "object":
        return "mapping"
    if entry.get("maximum", math.inf) >= 1e5:
        return str(entry["type"])
    return f"{entry['minimum']:g} to {entry['maximum']:g}"


def signals() -> str:
    """The signals of the DBC, as CSV."""
    layouts = load().by_name.values()
    return "\n".join([SIGNALS, *(signal_row(one, s) for one in layouts for s in one.signals.values())]) + "\n"


def signal_row(layout: Layout, signal: Signal) -> str:
    """A signal of a message; byte and bit count from 1."""
    byte, bit = divmod(signal.start, 8)
    position = f"{byte + 1}.{bit + 1}" if signal.bits < 8 else f"{byte + 1}"
    if signal.bits > 8:
        position += f"-{byte + signal.bits // 8}"
    period = f"{layout.period_s * 1e3:g} ms" if layout.period_s else "on request or change"
    number = (f"{signal.scale:.8g}", f"{signal.offset:g}", f"{signal.offset:g}")
    highest = f"{signal.offset + signal.scale * signal.last:.7g}"
    where = (signal.name, str(signal.spn or "own"), position, str(signal.bits), signal.unit or "-")
    return ",".join((layout.name, str(layout.pgn), period, *where, *number, highest))


def put(page: Path, mark: str, text: str) -> None:
    """Replace what is between the marks of a page."""
    begin, end = f"<!-- {mark}: begin -->", f"<!-- {mark}: end -->"
    before, _, rest = page.read_text(encoding="utf-8").partition(begin)
    page.write_text(f"{before}{begin}\n{text}\n{end}{rest.partition(end)[2]}", encoding="utf-8")


if __name__ == "__main__":
    for (page, mark), text in tables().items():
        put(HERE / page, mark, text)
    (HERE / "j1939_signals.csv").write_text(signals(), encoding="utf-8")

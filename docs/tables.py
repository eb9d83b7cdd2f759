"""Writes the tables of pages that the source has, between their marks `<!-- NAME: begin -->` and
`<!-- NAME: end -->`: `make schemas`, after the schemas.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from deeptruck_core.pages.marked import put_between_marks
from deeptruck_core.signals import CHANNELS
from deeptruck_model.recordings.not_recorded import INPUTS
from deeptruck_model.recordings.units import canonical_units
from deeptruck_nodes import parameters
from deeptruck_nodes.topics import TOPICS, Topic

HERE = Path(__file__).parent
Schema = dict[str, Any]


def tables() -> dict[tuple[str, str], str]:
    """Every table by its page and mark."""
    columns, topics, vehicle = map(schema, ("columns", "topics", "vehicle"))
    fuel = columns["properties"]["channels"]["properties"]["fuel_rate"]  # its entry has every key but `part`
    both = fuel["properties"] | topics["properties"]["engine_command"]["properties"]
    return {
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


def topic_row(topic: Topic) -> str:
    """A topic; who publishes and receives it is said with the nodes."""
    names = "" if callable(topic.named) else ", ".join(topic.named)
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


if __name__ == "__main__":
    for (page, mark), text in tables().items():
        put_between_marks(HERE / page, mark, text)

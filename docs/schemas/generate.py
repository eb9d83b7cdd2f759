"""Writes the JSON Schemas of this folder, by which editors check files that users write: `make schemas`."""

from __future__ import annotations

import json
from pathlib import Path

from deeptruck_core.schema import Schema
from deeptruck_model.recordings import schemas
from truck_bridge.vehicles import schema

HERE = Path(__file__).parent


def texts() -> dict[str, str]:
    """Every file by its name."""
    known: dict[str, Schema] = {
        "columns": schemas.columns(),
        "topics": schemas.topics(),
        "vehicle": schema.VEHICLE,
    }
    return {
        f"{name}.schema.json": json.dumps(found, indent=1, ensure_ascii=False) + "\n"
        for name, found in known.items()
    }


if __name__ == "__main__":
    for name, text in texts().items():
        (HERE / name).write_text(text, encoding="utf-8")

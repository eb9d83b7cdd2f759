"""Writes the JSON Schemas of this folder, by which editors check files that users write: `make schemas`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from deeptruck_model.recordings import editor_schemas
from truck_bridge.vehicles import schema

HERE = Path(__file__).parent


def texts() -> dict[str, str]:
    """Every file by its name."""
    schemas: dict[str, dict[str, Any]] = {
        "columns": editor_schemas.of_columns(),
        "topics": editor_schemas.of_topics(),
        "vehicle": schema.VEHICLE,
    }
    return {
        f"{name}.schema.json": json.dumps(found, indent=1, ensure_ascii=False) + "\n"
        for name, found in schemas.items()
    }


if __name__ == "__main__":
    for name, text in texts().items():
        (HERE / name).write_text(text, encoding="utf-8")

"""Trucks, roads, speeds, drivers and sensors of the cases, drawn from the parameters of worlds.yaml."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from typing import Any

import yaml


@cache
def values() -> Mapping[str, Any]:
    """The content of worlds.yaml."""
    text = (resources.files(__name__) / "worlds.yaml").read_text(encoding="utf-8")
    read: Mapping[str, Any] = yaml.safe_load(text)
    return read


__all__: Sequence[str] = ["values"]

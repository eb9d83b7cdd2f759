"""Trucks, roads, speeds, drivers and sensors of the cases, drawn from the parameters of worlds.yaml."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from deeptruck_core.reading import package_yaml


@cache
def values() -> Mapping[str, Any]:
    """The content of worlds.yaml."""
    read: Mapping[str, Any] = package_yaml(__name__, "worlds.yaml")
    return read


__all__: Sequence[str] = ["values"]

"""Dataclasses to JSON data and back, by cattrs. The metadata of a field says where it differs in JSON:
`field(metadata=stored(digits=2))`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, fields, is_dataclass
from enum import StrEnum
from typing import Any, TypeVar, get_args, get_type_hints

import cattrs
import numpy as np
from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn, override

T = TypeVar("T")
Hook = Callable[..., Any]
KEY = "json"


@dataclass(frozen=True)
class Stored:
    """How a field is stored.

    `key`: its key, where that is not the field's name. `digits`, `figures`: numbers are rounded to so many
    decimals or significant figures. `earlier`: the key of an earlier schema, which is written too, and read
    where the present one is absent. `sparse`: left out where it equals its default. `hidden`: not written.
    `flat`: its entries stand among those of its owner. `later`: absent in an earlier schema; any other field
    that is always written is required.
    """

    key: str | None = None
    digits: int | None = None
    figures: int | None = None
    earlier: str | None = None
    sparse: bool = False
    hidden: bool = False
    flat: bool = False
    later: bool = False

    def rounded(self, x: Any) -> Any:
        """A number, or the numbers of a list, rounded."""
        if isinstance(x, list):
            return [self.rounded(item) for item in x]
        if not isinstance(x, float):
            return x
        return float(f"{x:.{self.figures}g}") if self.figures is not None else round(x, self.digits)


def stored(
    *,
    key: str | None = None,
    digits: int | None = None,
    figures: int | None = None,
    earlier: str | None = None,
    sparse: bool = False,
    hidden: bool = False,
    flat: bool = False,
    later: bool = False,
) -> dict[str, Stored]:
    """The metadata of a field, see `Stored`."""
    return {KEY: Stored(key, digits, figures, earlier, sparse, hidden, flat, later)}


def to_json(x: Any) -> Any:
    """A dataclass, or a container of such, as JSON data. NaN and infinities become null."""
    return _CONVERTER.unstructure(x)


def from_json(kind: type[T], data: Any) -> T:
    """Inverse of `to_json`: null becomes NaN where a number is needed, and unknown keys are ignored. Raises
    KeyError, TypeError or ValueError for data of another form."""
    return _CONVERTER.structure(data, kind)


_CONVERTER = cattrs.Converter(detailed_validation=False, unstruct_collection_overrides={tuple: list})


def _how(f: Field[Any]) -> Stored:
    return f.metadata.get(KEY, Stored())


def _writer(kind: Any) -> Hook:
    each = {f.name: _how(f) for f in fields(kind)}
    write = make_dict_unstructure_fn(
        kind,
        _CONVERTER,
        **{n: override(omit=s.hidden, omit_if_default=s.sparse) for n, s in each.items()},  # type: ignore[arg-type]
    )

    def hook(x: Any) -> dict[str, Any]:
        out: dict[str, Any] = {}
        written = write(x)  # those that may be left out come last
        for name, s in each.items():
            if name not in written:
                continue
            value = written[name]
            if s.flat:
                out |= value or {}
                continue
            out[s.key or name] = s.rounded(value) if s.digits is not None or s.figures is not None else value
            if s.earlier is not None:
                out[s.earlier] = value
        return out

    return hook


def _reader(kind: Any) -> Hook:
    each, hints = {f.name: _how(f) for f in fields(kind)}, get_type_hints(kind)
    read = make_dict_structure_fn(
        kind,
        _CONVERTER,
        **{n: override(omit=s.hidden) for n, s in each.items()},  # type: ignore[arg-type]
    )

    flat = {name: _keys(hints[name]) for name, s in each.items() if s.flat}

    def hook(data: Any, _: Any) -> Any:
        if not isinstance(data, Mapping):
            raise TypeError(f"{data!r} is no {kind.__name__}")
        values: dict[str, Any] = {}
        for name, s in each.items():
            if name in flat:
                values[name] = {key: x for key, x in data.items() if key in flat[name]} or None
                continue
            key = s.key or name
            if key not in data and s.earlier in data:
                key = s.earlier
            if key in data:
                values[name] = data[key]
            elif not (s.sparse or s.hidden or s.later):
                raise KeyError(key)
        return read(values, kind)

    return hook


def _keys(hint: Any) -> set[str]:
    (kind,) = (t for t in (hint, *get_args(hint)) if is_dataclass(t))
    return {_how(f).key or f.name for f in fields(kind)}


def _plain(kind: type) -> Hook:
    def hook(x: Any, _: Any) -> Any:
        if not isinstance(x, kind) or (isinstance(x, bool) and kind is not bool):
            raise TypeError(f"{x!r} is no {kind.__name__}")
        return x

    return hook


def _number(x: Any, _: Any) -> float:
    if x is None:
        return math.nan
    if isinstance(x, bool) or not isinstance(x, (int, float)):
        raise TypeError(f"{x!r} is no number")
    return float(x)


def _finite(x: Any) -> float | None:
    return float(x) if math.isfinite(x) else None


_CONVERTER.register_unstructure_hook_factory(is_dataclass, _writer)
_CONVERTER.register_structure_hook_factory(is_dataclass, _reader)
for _kind in (bool, int, str):
    _CONVERTER.register_structure_hook(_kind, _plain(_kind))
_CONVERTER.register_structure_hook(float, _number)
_CONVERTER.register_structure_hook(StrEnum, lambda x, kind: kind(x))
_CONVERTER.register_unstructure_hook(StrEnum, lambda x: x.value)
for _kind in (bool, int):
    _CONVERTER.register_unstructure_hook(_kind, _kind)
for _kind in (float, np.floating):
    _CONVERTER.register_unstructure_hook(_kind, _finite)
_CONVERTER.register_unstructure_hook(np.bool_, bool)
_CONVERTER.register_unstructure_hook(np.integer, int)
_CONVERTER.register_unstructure_hook(np.ndarray, lambda x: _CONVERTER.unstructure(x.tolist()))

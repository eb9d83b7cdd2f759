"""Converts dataclasses to JSON data and back, by cattrs. The metadata of a field describes its form in JSON:
`field(metadata=stored(digits=2))`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from enum import StrEnum
from functools import cache
from typing import TYPE_CHECKING, Any, Literal, TypeVar, get_args, get_origin, get_type_hints

if TYPE_CHECKING:
    from cattrs import Converter

T = TypeVar("T")
Hook = Callable[..., Any]
KEY = "json"


@dataclass(frozen=True)
class Stored:
    """How a field is stored.

    `key`: its key, if that is not the field's name. `digits`, `figures`: decimals or significant figures to
    which numbers are rounded. `earlier`: its key in an earlier schema, which is written too, and read if the
    present one is absent. `sparse`: omitted if it equals its default. `hidden`: not written. `flat`: its
    entries are written among those of its owner. `later`: absent in an earlier schema; any other field that
    is always written is required.
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
        if not isinstance(x, float) or self.digits is self.figures is None:
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


SPARSE, HIDDEN = stored(sparse=True), stored(hidden=True)


def to_json(x: Any) -> Any:
    """A dataclass, or a container of such, as JSON data. NaN and infinities become null."""
    return _converter().unstructure(x)


def from_json(kind: type[T], data: Any) -> T:
    """Inverse of `to_json`: null becomes NaN for a number, and unknown keys are ignored. Raises KeyError,
    TypeError or ValueError for data of another form."""
    return _converter().structure(data, kind)


@cache
def _converter() -> Converter:
    import numpy as np  # both take longer to import than a short command runs
    from cattrs import Converter

    c = Converter(detailed_validation=False, unstruct_collection_overrides={tuple: list})
    c.register_unstructure_hook_factory(is_dataclass, _writer)
    c.register_unstructure_hook(StrEnum, lambda x: x.value)
    c.register_unstructure_hook(bool, bool)
    c.register_unstructure_hook(int, int)
    c.register_unstructure_hook(float, _finite)
    c.register_unstructure_hook(np.bool_, bool)
    c.register_unstructure_hook(np.integer, int)
    c.register_unstructure_hook(np.floating, _finite)
    c.register_unstructure_hook(np.ndarray, lambda x: c.unstructure(x.tolist()))
    c.register_structure_hook_factory(is_dataclass, _reader)
    for kind in (bool, int, str):
        c.register_structure_hook(kind, _plain(kind))
    c.register_structure_hook(float, _number)
    c.register_structure_hook(StrEnum, lambda x, kind: kind(x))
    c.register_structure_hook_func(_is_choice, _choice)
    return c


def _how(kind: Any) -> dict[str, Stored]:
    return {f.name: f.metadata.get(KEY, Stored()) for f in fields(kind)}


def _writer(kind: Any) -> Hook:
    from cattrs.gen import make_dict_unstructure_fn, override

    each = _how(kind)
    options = {name: override(omit=s.hidden, omit_if_default=s.sparse) for name, s in each.items()}
    write = make_dict_unstructure_fn(kind, _converter(), **options)  # type: ignore[arg-type]

    def hook(x: Any) -> dict[str, Any]:
        out: dict[str, Any] = {}
        written = write(x)  # those that may be left out come last
        for name, s in each.items():
            if name not in written:
                continue
            value = s.rounded(written[name])
            if s.flat:
                out |= value or {}
                continue
            out[s.key or name] = value
            if s.earlier is not None:
                out[s.earlier] = value
        return out

    return hook


def _reader(kind: Any) -> Hook:
    from cattrs.gen import make_dict_structure_fn, override

    each, hints = _how(kind), get_type_hints(kind)
    flat = {name: _keys(hints[name]) for name, s in each.items() if s.flat}
    options = {name: override(omit=s.hidden) for name, s in each.items()}
    read = make_dict_structure_fn(kind, _converter(), **options)  # type: ignore[arg-type]

    def hook(data: Any, _: Any) -> Any:
        if not isinstance(data, Mapping):
            raise TypeError(f"{data!r} is no {kind.__name__}")
        values: dict[str, Any] = {}
        for name, s in each.items():
            if name in flat:
                values[name] = {key: x for key, x in data.items() if key in flat[name]} or None
                continue
            found = [key for key in (s.key or name, s.earlier) if key in data]
            if found:
                values[name] = data[found[0]]
            elif not (s.sparse or s.hidden or s.later):
                raise KeyError(s.key or name)
        return read(values, kind)

    return hook


def _keys(hint: Any) -> set[str]:
    (kind,) = (t for t in (hint, *get_args(hint)) if is_dataclass(t))
    return {s.key or name for name, s in _how(kind).items()}


def _plain(kind: type) -> Hook:
    def hook(x: Any, _: Any) -> Any:
        if not isinstance(x, kind) or (isinstance(x, bool) and kind is not bool):
            raise TypeError(f"{x!r} is no {kind.__name__}")
        return x

    return hook


def _is_choice(kind: Any) -> bool:
    origin: Any = get_origin(kind)
    return origin is Literal


def _choice(x: Any, kind: Any) -> Any:
    if x not in get_args(kind):
        raise ValueError(f"{x!r} is none of {get_args(kind)}")
    return x


def _number(x: Any, _: Any) -> float:
    if x is None:
        return math.nan
    if isinstance(x, bool) or not isinstance(x, int | float):
        raise TypeError(f"{x!r} is no number")
    return float(x)


def _finite(x: Any) -> float | None:
    return float(x) if math.isfinite(x) else None

"""Sentences that carry the names in them, so that nobody has to look for them by a pattern."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Named:
    """The name of an effect or a signal, within a sentence."""

    name: str


Part = str | Named


@dataclass(frozen=True)
class Sentence:
    """Words, and the names among them: verdict.json has names as they are, people get them in words."""

    parts: tuple[Part, ...]

    @staticmethod
    def of(*parts: Part) -> Sentence:
        """Of these parts, one after the other."""
        return Sentence(parts)

    @staticmethod
    def named(names: Sequence[str]) -> tuple[Part, ...]:
        """Names in a row."""
        row = [part for name in names for part in (", ", Named(name))]
        return tuple(row[1:])

    def __str__(self) -> str:
        return "".join(part.name if isinstance(part, Named) else part for part in self.parts)

    def and_then(self, *more: Part) -> Sentence:
        """With another sentence behind it, whose first letter becomes a capital."""
        first, *rest = more
        if isinstance(first, str):
            first = first[:1].upper() + first[1:]
        return Sentence((*self.parts, ". ", first, *rest))

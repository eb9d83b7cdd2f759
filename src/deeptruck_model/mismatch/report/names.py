"""Names of findings in a sentence, each with what it is not distinguishable from, as many as it holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from deeptruck_model.mismatch.finding import Kind
from deeptruck_model.mismatch.report.wording import spoken

LONGEST = 30  # words in a sentence
NAMED, RIVALS = 4, 3  # names, and others that each may be, in one sentence


@dataclass(frozen=True)
class Name:
    """A finding, and what it is not distinguishable from: it is then told as a group and not alone."""

    effect: str
    kind: Kind
    rivals: tuple[str, ...] = ()
    size: str = ""  # with its unit; empty where it is not known
    sure: str = ""  # the probability of the effect by itself; empty where it is not known

    @property
    def details(self) -> str:
        """How large and how sure, behind the name."""
        known = [*filter(None, [self.size, f"{self.sure} sure" if self.sure else ""])]
        return f" ({', '.join(known)})" if known else ""


def group(name: Name, rivals: int = RIVALS) -> str:
    """A name with what is not distinguishable: 'headwind or rolling resistance that grows with speed'."""
    return either([name.effect, *name.rivals], rivals + 1)


def with_details(n: Name, rivals: int) -> str:
    """A group, with how large and how sure behind its first name."""
    rest = group(n, rivals).removeprefix(spoken_effect(n.effect))
    return f"{spoken_effect(n.effect)}{n.details}{rest}"


def either(effects: Sequence[str], most: int) -> str:
    """Names of effects as alternatives, `most` of them."""
    told = [spoken_effect(effect) for effect in effects[:most]]
    return " or ".join(told if len(told) == len(effects) else [*told, "others"])


def in_a_row(names: Sequence[Name], most: int, rivals: int, each: str = " ") -> str:
    """The first names in a row, each after the word `each`, which begins the row without it."""
    told = [with_details(n, rivals) for n in names[:most]]
    if more := len(names) - len(told):
        told.append(f"{more} more")
    if len(told) < 3:
        return f" and{each}".join(told)
    return f"{f',{each}'.join(told[:-1])}, and{each}{told[-1]}"


def spoken_effect(effect: str) -> str:
    return "a force without a name" if effect == "unknown" else spoken(effect)


def fitting(say: Callable[[int, int], str]) -> str:
    """The sentence say(names, rivals) with as many names and rivals as LONGEST words hold."""
    sizes = ((names, rivals) for names in range(NAMED, 0, -1) for rivals in range(RIVALS, -1, -1))
    said = (say(*size) for size in sizes)
    return next((s for s in said if len(s.split()) <= LONGEST), say(1, 0))

"""Mechanisms of the user in addition to the library, from Python or from a file."""

from __future__ import annotations

import hashlib
import runpy
from collections.abc import Collection, Iterable, Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args

from deeptruck_core.errors import InputError
from deeptruck_core.signals import CHANNELS
from deeptruck_model import calls
from deeptruck_model.mismatch.mechanisms.record import Curve, Family, Form, Mechanism
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.recordings import Recording

EXTRA, SENSITIVITY = "extra: ", "sensitivity:"  # begins of names: a channel of the user's, a parameter
DERIVED = frozenset({"rolling", "effective_mass_gain", "place"})  # in addition to what mechanisms take
KINDS = ("missing_physics", "measurement_fault")
MEND = "a file of mechanisms is Python with MECHANISMS = (Mechanism(...), ...), see docs/mismatch.md"


class Library(dict[str, Mechanism]):
    """Mechanisms by effect. It iterates over those of the package; `in` and `[]` find the user's too."""

    def __init__(self, package: Iterable[Mechanism]) -> None:
        super().__init__({m.effect: m for m in package})
        self.own: dict[str, Mechanism] = {}
        self.files: dict[str, dict[str, str]] = {}  # of the user's: path and SHA-256

    def __contains__(self, effect: object) -> bool:
        return super().__contains__(effect) or effect in self.own

    def __missing__(self, effect: str) -> Mechanism:
        return self.own[effect]

    def of_input(self, name: str) -> Mechanism:
        """The mechanism of the package that is the error of an input."""
        return next(m for m in self.values() if m.of_input == name)

    def read(self, path: Path, sha256: str | None = None) -> tuple[Mechanism, ...]:
        """The mechanisms of a user's file. Raises InputError if there are none, or if its content has not
        the hash `sha256`."""
        try:
            content = path.read_bytes()
        except OSError as error:
            raise InputError(f"{path} cannot be read: {error.strerror}; {MEND}") from None
        found = hashlib.sha256(content).hexdigest()
        if sha256 not in (None, found):
            raise InputError(f"{path} has changed since a correction was made with it; run mismatch again")
        try:
            given = runpy.run_path(str(path)).get("MECHANISMS", ())
        except Exception as error:  # of the user's code
            raise InputError(f"{path} cannot be run ({error!r}); {MEND}") from None
        mechanisms = checked(given, self.values())
        if not mechanisms:
            raise InputError(f"{path} has no MECHANISMS; {MEND}")
        for m in mechanisms:
            self.files[m.effect] = {"file": str(path.resolve()), "sha256": found}
        return mechanisms


def checked(given: Any, package: Iterable[Mechanism]) -> tuple[Mechanism, ...]:
    """The user's mechanisms. Raises InputError for anything else, for a record that cannot be used, and for
    a signal that neither recordings nor the mechanisms of the `package` have."""
    if isinstance(given, str | Path) or not isinstance(given, Iterable):
        raise InputError(f"mechanisms must be a list of Mechanism(...), not {calls.shown(given)}")
    mechanisms = tuple(given)
    for m in mechanisms:
        if not isinstance(m, Mechanism):
            raise InputError(f"mechanisms must be a list of Mechanism(...), not {calls.shown(m)}")
        for problem in _problems(m):
            raise InputError(f"the mechanism '{m.effect}' {problem}")
    if len({m.effect for m in mechanisms}) < len(mechanisms):
        raise InputError("two mechanisms have one name; give each its own")
    known = {*CHANNELS, *DERIVED, *(name for m in package for name in signals(m))}
    for m in mechanisms:
        _check_among({x for x in signals(m) if not x.startswith((EXTRA, SENSITIVITY))}, known, m)
    return mechanisms


def check_extras(own: Iterable[Mechanism], recordings: Iterable[Recording]) -> None:
    """Raises InputError if a mechanism of the user's names a channel of the user's that no recording has."""
    recorded = {EXTRA + name for r in recordings for name in r.channels}
    for m in own:
        _check_among({x for x in signals(m) if x.startswith(EXTRA)}, recorded, m)


def _check_among(names: Iterable[str], known: Collection[str], m: Mechanism) -> None:
    for name in sorted(set(names) - set(known)):
        near = get_close_matches(name, known, 1)
        hint = f"did you mean '{near[0]}'?" if near else f"there are {', '.join(sorted(known))}"
        raise InputError(f"the mechanism '{m.effect}' asks for '{name}', which is no signal; {hint}")


def signals(m: Mechanism, e: Evidence | None = None) -> set[str]:
    """The signals that a mechanism needs, and those in its forms, as far as these do not depend on `e`."""
    out = set(m.needs)
    for form in m.forms.values():
        out |= set(form.needs)
        if isinstance(form, Curve):
            out |= form.carrier.signals() | form.of.signals()
            continue
        each = form.constants
        if callable(each):
            if e is None or not e.has(*out):
                continue  # its constants may depend on them
            each = each(e)
        for constants in each:
            out |= frozenset[str]().union(*(c.expression.signals() for c in form.made(constants)))
            break
    return out


def not_compared(
    own: Sequence[Mechanism], package: Iterable[Mechanism], compared: Collection[Mechanism], e: Evidence
) -> Iterator[str]:
    """Which mechanisms were not `compared` and why: a line for each of the user's, one for all others."""
    for m in own:
        lacking = sorted(name for name in signals(m, e) if not e.has(name))
        if lacking:
            part = "" if m not in compared else " as a whole"
            yield (
                f"your mechanism '{m.effect}' was not compared{part}: of {' and '.join(lacking)} less than "
                "half of the samples are known"
            )
    others: dict[str, list[str]] = {}
    for m in package:
        lacking = [name for name in m.needs if not e.has(name)]
        if m not in compared and lacking:
            others.setdefault(" and ".join(lacking), []).append(m.effect)
    if others:
        each = "; ".join(f"without {names}: {', '.join(effects)}" for names, effects in others.items())
        yield f"mechanisms that were not compared, as their signals were not recorded: {each}"


def _problems(m: Mechanism) -> Iterator[str]:
    if not m.effect.isidentifier():
        yield "needs a name of letters, digits and underscores"
    if m.family not in get_args(Family):
        yield f"has the family '{m.family}'; there are {', '.join(get_args(Family))}"
    if m.kind not in KINDS:
        yield f"is of the kind '{m.kind}'; there are {', '.join(KINDS)}"
    if not m.forms:
        yield "has no form"
    for name, form in m.forms.items():
        if isinstance(form, Form) and not callable(form.constants):
            try:
                for constants in form.constants:
                    form.made(constants)
            except Exception as error:  # of the user's code
                yield f"has a form '{name}' that cannot be made ({error!r})"
        if isinstance(form, Form):
            for constant, (low, high) in form.fitted.items():
                if not 0.0 < low < high:
                    yield f"has limits of '{constant}' in '{name}' that are not 0 < low < high: {low}, {high}"

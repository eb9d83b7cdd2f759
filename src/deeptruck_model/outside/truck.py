"""Adapts a simulator by another author: checks its results, and adds optional members that it lacks."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.outside.reference import FMU, PYTHON, Reference, asked, made, refer

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

KIND, MANIFEST, SCHEMA = "outside", "simulator.json", 1
LONGEST_DT = 60.0  # s
NEEDED = {  # what the object must have, and the form of it
    "interface": "a deeptruck_core.signals.TruckInterface",
    "dt": "its step in s",
    "reset": "reset(y0) -> state",
    "step": "step(state, u, w) -> (state, y)",
}


def lacks(simulator: Any) -> dict[str, str]:
    """Members that an object lacks to be a simulator, each with the remedy."""
    found = {}
    for name, form in NEEDED.items():
        what = getattr(simulator, name, None)
        if what is None or (name in ("reset", "step") and not callable(what)):
            found[name] = f"it has no {name}; add {form}"
    interface, dt = getattr(simulator, "interface", None), getattr(simulator, "dt", None)
    if interface is not None and not isinstance(interface, TruckInterface):
        found["interface"] = f"its interface is a {type(interface).__name__}; make it {NEEDED['interface']}"
    if dt is not None and not (isinstance(dt, Real) and 0.0 < float(dt) <= LONGEST_DT):
        found["dt"] = f"its dt is {str(dt)[:40]}; give s, above 0 and at most {LONGEST_DT:g}"
    if hasattr(simulator, "parameters") and not hasattr(simulator, "with_parameters"):
        found["with_parameters"] = "it has parameters() and no with_parameters(values); add it, or omit both"
    return found


class WithForce:
    """Adds `force` to a truck without it, by a reset at each recorded response, which loses the internal
    state.

    The state here is the truck's state and its present response, (batch, n_y).
    """

    def __init__(self, inner: Any) -> None:
        self.inner = inner

    def __getattr__(self, name: str) -> Any:
        if name == "inner":
            raise AttributeError(name)
        return getattr(self.inner, name)

    def reset(self, y0: Array) -> tuple[Any, Array]:
        return self.inner.reset(y0), y0

    def step(self, state: tuple[Any, Array], u: Array, w: Array) -> tuple[tuple[Any, Array], Array]:
        after, y = self.inner.step(state[0], u, w)
        return (after, y), y

    def force(self, state: tuple[Any, Array], y: Array) -> tuple[Any, Array]:
        import numpy as np

        recorded = np.where(np.isnan(y), state[1], y)
        return state if np.isnan(y).all() else (self.inner.reset(recorded), recorded)

    def inside(self, state: tuple[Any, Array]) -> Any:
        return self.inner.inside(state[0]) if hasattr(self.inner, "inside") else {}

    def with_parameters(self, values: Mapping[str, float]) -> WithForce:
        return WithForce(self.inner.with_parameters(values))


class OutsideTruck:
    """A Simulator around an object that has all of NEEDED, called `named` in messages.

    `reference` is its source, None for an object that was passed. `values` are parameters changed since its
    factory made it. Members beyond the protocol (rollout, driven, command_range ...) are passed on.
    """

    def __init__(
        self,
        inner: Any,
        named: str,
        reference: Reference | None = None,
        values: Mapping[str, float] | None = None,
    ) -> None:
        self._inner = inner if hasattr(inner, "force") else WithForce(inner)
        self._named, self._reference, self._values = named, reference, dict(values or {})

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        beyond = getattr(self._inner, name)
        return self._checked_rollout(beyond) if name == "rollout" else beyond

    @property
    def starts_anew(self) -> bool:
        """Whether it has no `force` and is reset at recorded responses."""
        return isinstance(self._inner, WithForce)

    @property
    def interface(self) -> TruckInterface:
        own: TruckInterface = self._inner.interface
        return own

    @property
    def dt(self) -> float:
        return float(self._inner.dt)

    def reset(self, y0: Array) -> Any:
        with self._asked("reset"):
            return self._inner.reset(y0)

    def step(self, state: Any, u: Array, w: Array) -> tuple[Any, Array]:
        with self._asked("step"):
            after, y = self._inner.step(state, u, w)
            return after, _numbers(y, (len(u), len(self.interface.y)), "step")

    def force(self, state: Any, y: Array) -> Any:
        with self._asked("force"):
            return self._inner.force(state, y)

    def inside(self, state: Any) -> dict[str, Array]:
        if not hasattr(self._inner, "inside"):
            return {}
        import numpy as np

        with self._asked("inside"):
            return {str(n): np.asarray(x, np.float64) for n, x in self._inner.inside(state).items()}

    def parameters(self) -> dict[str, float]:
        if not hasattr(self._inner, "parameters"):
            return {}
        with self._asked("parameters"):
            return {str(name): float(value) for name, value in self._inner.parameters().items()}

    def with_parameters(self, values: Mapping[str, float]) -> OutsideTruck:
        unknown = sorted(set(values) - set(self.parameters()))
        if unknown:
            raise InputError(f"{self._named} has no parameter {', '.join(unknown)}")
        if not values:
            return self
        with self._asked("with_parameters"):
            other = self._inner.with_parameters(dict(values))
        return OutsideTruck(other, self._named, self._reference, {**self._values, **values})

    def save(self, path: Path) -> None:
        """Write its source, with the hashes of its files; `saved.load_directory` makes it again.

        Of a truck that was passed as a Python object only a description is written, which cannot be loaded.
        """
        content = {"interface": self.interface.to_dict(), "dt": self.dt, "parameters": self._values}
        if self._reference is None:
            _write(path, {"simulator": None, "object": self._named} | content)
        else:
            _write(path, self._reference.to_dict() | content)

    def _checked_rollout(self, rollout: Callable[..., Any]) -> Callable[..., Any]:
        def checked(u: Array, w: Array, y0: Array, recorded: Array | None = None) -> Any:
            with self._asked("rollout"):
                run = rollout(u, w, y0, recorded)
                _numbers(run.y, (len(u), u.shape[1], len(self.interface.y)), "rollout", begins=1)
                return run

        return checked

    def _asked(self, method: str) -> Any:
        return asked(self._named, method)


def _numbers(y: Any, shape: tuple[int, ...], method: str, begins: int = 0) -> Array:
    import numpy as np

    numbers = np.asarray(y, np.float64)
    if numbers.shape != shape:
        raise InputError(f"its y has shape {numbers.shape}, expected {shape}; mend its {method}")
    if not np.isfinite(numbers[:, begins:]).all():
        raise InputError(
            f"its y is not finite: it diverged, or was driven where it cannot be; mend its {method}"
        )
    return numbers


def adopted(reference: Reference) -> OutsideTruck:
    """The factory's object as a Simulator. Raises InputError if it is not one."""
    inner = made(reference)
    if missing := lacks(inner):
        what = f"what {reference.factory} returns is no simulator: {', '.join(missing.values())}"
        raise InputError(f"{reference.text}: {what}")
    return OutsideTruck(inner, reference.text, reference)


def adapted(inner: Any) -> OutsideTruck:
    """An object as a Simulator. Raises InputError if it lacks any of NEEDED."""
    named = f"{type(inner).__module__}.{type(inner).__qualname__}"
    if missing := lacks(inner):
        raise InputError(f"{named} is no simulator: {', '.join(missing.values())}")
    return OutsideTruck(inner, named)


_looked_at: dict[Reference, tuple[TruckInterface, float]] = {}
_waiting: dict[Reference, OutsideTruck] = {}  # looked at, and not yet taken: a factory may be slow


def look(text: str) -> tuple[TruckInterface, float]:
    """Interface and dt of a simulator named by one of `reference.SCHEMES`. Raises InputError as
    `load` does."""
    reference = refer(text)
    if reference not in _looked_at:
        truck = _waiting[reference] = adopted(reference)
        _looked_at[reference] = truck.interface, truck.dt
    return _looked_at[reference]


def load_text(text: str) -> OutsideTruck:
    """The simulator of python:TEXT; see `load`."""
    return load(PYTHON + text)


def load_fmu(text: str) -> OutsideTruck:
    """The simulator of fmu:TEXT; see `load`."""
    return load(FMU + text)


def load(text: str) -> OutsideTruck:
    """The simulator named by one of `reference.SCHEMES`.

    Raises InputError if it is not found, cannot be made, or is no simulator.
    """
    reference = refer(text)
    waiting = _waiting.pop(reference, None)
    return adopted(reference) if waiting is None else waiting


def keep(simulator: Any, path: Path) -> None:
    """Save a simulator that is corrected as the folder `path`.

    For an object that was passed and cannot save itself in a loadable form, a description is written, and a
    note on stderr says how to pass one that can be loaded.
    """
    with suppress(NotImplementedError):  # nobody else's object needs to know how to save itself
        if hasattr(simulator, "save"):
            simulator.save(path)
    if (path / MANIFEST).is_file():
        return
    kind = type(simulator)
    name = f"{kind.__module__}.{kind.__qualname__}"
    print(
        f"note: {path} only describes the simulator, an object of {name}: to load it later, pass "
        "'python:MODULE:FACTORY', a function that makes it",
        file=sys.stderr,
    )
    content = {"interface": simulator.interface.to_dict(), "dt": simulator.dt, "parameters": {}}
    _write(path, {"simulator": None, "object": name} | content)


def _write(path: Path, content: Mapping[str, Any]) -> None:
    path.mkdir(parents=True, exist_ok=True)
    (path / MANIFEST).write_text(json.dumps({"kind": KIND, "schema": SCHEMA, **content}, indent=1))

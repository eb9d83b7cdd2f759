"""An FMU for co-simulation, FMI 2 or 3, as a simulator that FMPy runs.

An FMU runs forward only, but a simulator's old states stay usable. A state here is a position in a drive,
which is a start and all inputs since. The instance that is there does the next step; if there is none,
another one is started and driven along the same inputs, to the same result as an FMU is deterministic.
"""

from __future__ import annotations

import math
import tempfile
import weakref
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_core import reading
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELERATION, FUEL, SPEED
from deeptruck_model.fmu import mapping
from deeptruck_model.fmu.mapping import Names

MISSING = "FMUs need FMPy; install it with \"pip install 'deeptruck[fmu]'\""
EXPORT_AGAIN = "export it again as FMI 2 or 3 for co-simulation"
HARDEST = 30.0  # m/s^2; a vehicle that seems to be accelerated more in its first step began at another speed
FEWEST = 8  # instances, before one is taken from a drive that may still go on


def make(file: Path, given: Mapping[Any, Any] | None) -> FmuTruck:
    """The simulator in a .fmu file, whose variables the mapping `given` names.

    Raises InputError for a file that is no FMU, and for a mapping that is missing or does not fit.
    """
    described = _description(file)
    names = mapping.read(described, given)
    return FmuTruck(Instances(described, file, names), names, names.values)


def _description(file: Path) -> Any:
    """What FMPy reads of an FMU. Raises InputError for any other file."""
    reading.check_file(file, "give the path of an FMU")
    try:
        from fmpy import read_model_description
    except ImportError:
        raise InputError(MISSING) from None
    try:
        described = read_model_description(str(file), validate=False)
    except Exception as error:  # whatever a damaged archive or description makes a library raise
        said = reading.plain(str(error)) or type(error).__name__
        raise InputError(f"it is no FMU, or damaged ({said}); {EXPORT_AGAIN}") from None
    if described.fmiVersion[:1] not in ("2", "3") or described.coSimulation is None:
        kind = f"FMI {described.fmiVersion}" + ("" if described.coSimulation else ", without co-simulation")
        raise InputError(f"it is {kind}; {EXPORT_AGAIN}")
    return described


class Drive:
    """A start (variables and numbers) and all inputs since. `instance` is the one that drove it last."""

    __slots__ = ("__weakref__", "instance", "start", "steps")

    def __init__(self, start: Sequence[tuple[Any, float]], steps: Sequence[Sequence[float]] = ()) -> None:
        self.start, self.steps = start, [*steps]
        self.instance: Instance | None = None


class Instances:
    """The instances of an FMU, the one used last at the end."""

    def __init__(self, described: Any, file: Path, names: Names) -> None:
        self._described, self._file, self._names = described, file, names
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._running: list[Instance] = []
        self.most = FEWEST
        weakref.finalize(self, _close, self._running)

    def step(self, drive: Drive, length: int, inputs: Sequence[float]) -> tuple[Drive, list[float]]:
        """One step after the first `length` of a drive: the drive with that step, and the outputs. If it has
        gone on from there already, that is a new drive."""
        instance = drive.instance
        if instance is None or instance.drive() is not drive or instance.length != length:
            instance = self._free()
            instance.start(drive)
            for earlier in drive.steps[:length]:
                instance.step(earlier)
        if length < len(drive.steps):
            drive = Drive(drive.start, drive.steps[:length])
        drive.steps.append(inputs)
        instance.drive, drive.instance = weakref.ref(drive), instance
        self._running.remove(instance)
        self._running.append(instance)
        return drive, instance.step(inputs)

    def begin(self, drive: Drive) -> list[float]:
        """The outputs at the start of a drive."""
        instance = self._free()
        out = instance.start(drive)
        drive.instance = instance
        return out

    def _free(self) -> Instance:
        """An instance whose drive is no longer needed, a new one, or the one unused for longest."""
        alone = self._described.coSimulation.canBeInstantiatedOnlyOncePerProcess
        found = next((one for one in self._running if one.drive() is None), None)
        if found is None and (not self._running or (not alone and len(self._running) < self.most)):
            self._running.append(Instance(self._described, self._unpacked(), self._names))
            return self._running[-1]
        return found or self._running[0]

    def _unpacked(self) -> str:
        if self._folder is None:
            from fmpy import extract

            self._folder = tempfile.TemporaryDirectory(prefix="deeptruck_fmu_")
            with _asked("be unpacked", []):
                extract(str(self._file), self._folder.name)
        return self._folder.name


def _close(instances: Sequence[Instance]) -> None:
    for instance in instances:
        instance.close()


class Instance:
    """A running instance of an FMU: `length` steps into a `drive`."""

    def __init__(self, described: Any, folder: str, names: Names) -> None:
        import scipy.linalg  # noqa: F401  where an FMU in Python loads it first, the process aborts as it ends

        self.drive: Any = lambda: None
        self.length = 0
        self._described, self._folder = described, folder
        self._dt, self._substeps = names.dt / names.substeps, names.substeps
        inputs = [*names.inputs, *names.measured.values()]
        self._in, self._out = ([link.variable for link in links] for links in (inputs, names.outputs))
        self._words = deque[str](maxlen=2)
        self._fresh = True
        self._make()

    def start(self, drive: Drive) -> list[float]:
        """Begin a drive, and return the outputs."""
        if not self._fresh:
            try:
                self._fmu.reset()
            except Exception:  # some FMUs cannot
                self.close()
                self._make()
        self._fresh, self.length, self.drive = False, 0, weakref.ref(drive)
        with _asked("initialise", self._words):
            if self._described.fmiVersion.startswith("2"):
                self._fmu.setupExperiment(startTime=0.0)
            self._write(*zip(*drive.start, strict=True))
            self._fmu.enterInitializationMode()
            self._fmu.exitInitializationMode()
            return self._read()

    def step(self, inputs: Sequence[float]) -> list[float]:
        """Advance by one step of ours, and return the outputs."""
        at = self.length * self._substeps
        with _asked(f"step at {at * self._dt:.4g} s", self._words):
            self._write(self._in, inputs)
            for k in range(self._substeps):
                self._fmu.doStep((at + k) * self._dt, self._dt)
            self.length += 1
            return self._read()

    def close(self) -> None:
        """End the instance; it may hold a licence."""
        for end in (self._fmu.terminate, self._fmu.freeInstance):
            with suppress(Exception):
                end()

    def _make(self) -> None:
        from fmpy.simulation import instantiate_fmu

        with _asked("be loaded", self._words):
            self._fmu = instantiate_fmu(self._folder, self._described, "CoSimulation", logger=self._hear)
        self._fresh = True

    def _hear(self, *said: Any) -> None:
        """A message of the FMU, which FMPy would print."""
        status, text = said[-3], said[-1]
        if status > 0 and text:
            self._words.append(text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text))

    def _write(self, variables: Sequence[Any], numbers: Sequence[float]) -> None:
        for kind in dict.fromkeys(v.type for v in variables):
            of = [(v.valueReference, x) for v, x in zip(variables, numbers, strict=True) if v.type == kind]
            given = [x if kind in ("Real", "Float64", "Float32") else round(x) for _, x in of]
            getattr(self._fmu, f"set{self._called(kind)}")([reference for reference, _ in of], given)

    def _read(self) -> list[float]:
        found: dict[int, float] = {}
        for kind in dict.fromkeys(v.type for v in self._out):
            references = [v.valueReference for v in self._out if v.type == kind]
            found |= zip(references, getattr(self._fmu, f"get{self._called(kind)}")(references), strict=True)
        return [float(found[v.valueReference]) for v in self._out]

    def _called(self, kind: str) -> str:
        """What FMI calls the functions of a type."""
        if kind != "Enumeration":
            return kind
        return "Integer" if self._described.fmiVersion.startswith("2") else "Int64"


@contextmanager
def _asked(what: str, words: Sequence[str]) -> Iterator[None]:
    """Turns FMPy's exceptions into one line with the FMU's last message."""
    try:
        yield
    except Exception as error:
        own = f"; it says: {reading.plain(words[-1])}" if words else ""
        raise InputError(f"it cannot {what} ({reading.plain(str(error)).rstrip('.')}){own}") from error


@dataclass(frozen=True)
class Row:
    """A truck of the batch: `length` steps into its drive, its present response, and the FMU's outputs.
    `measured` is a recorded speed and acceleration that replace its own at the next step."""

    drive: Drive
    length: int
    speed: float
    acceleration: float
    out: Sequence[float]
    measured: tuple[float, float] | None = None


State = tuple[Row, ...]


class FmuTruck:
    """A batch of trucks, each a drive of one FMU; `values` are its parameters, in SI."""

    def __init__(self, instances: Instances, names: Names, values: Mapping[str, float]) -> None:
        self.interface, self.dt = names.interface, names.dt
        self._instances, self._names, self._values = instances, names, values

    def reset(self, y0: Array) -> State:
        """A state at y0 (batch, n_y): the FMU is started there."""
        self._instances.most = max(self._instances.most, 2 * len(y0))
        return tuple(self._begun(float(y[SPEED]), float(y[ACCELERATION])) for y in np.asarray(y0, np.float64))

    def step(self, state: State, u: Array, w: Array) -> tuple[State, Array]:
        """One step under u (batch, n_u) and w (batch, n_w). Raises InputError if the FMU diverges, and if it
        began at another speed."""
        given = np.concatenate([np.asarray(u, np.float64), np.asarray(w, np.float64)], axis=1)
        columns = zip(self._names.inputs, given.T, strict=False)
        inputs = np.stack([link.theirs(x) for link, x in columns], axis=1)
        if not np.isfinite(inputs).all():
            raise InputError("a command or grade is not a finite number")
        after = tuple(self._stepped(row, x) for row, x in zip(state, inputs.tolist(), strict=True))
        y = np.zeros((len(after), len(self.interface.y)))
        y[:, ACCELERATION] = [row.acceleration for row in after]
        y[:, SPEED] = [row.speed for row in after]
        if self.interface.fuel:
            y[:, FUEL] = self._seen(after)["fuel_rate"]
        return after, y

    def force(self, state: State, y: Array) -> State:
        """The state at a recorded y (batch, n_y). An FMU that takes no recorded speed is started there."""
        return tuple(
            self._forced(row, *one[[SPEED, ACCELERATION]]) for row, one in zip(state, y, strict=True)
        )

    def inside(self, state: State) -> dict[str, Array]:
        """The outputs in the mapping besides the speed, and the mass if it has forces."""
        seen = self._seen(state)
        if "traction_force" in seen and "mass" in self._values:
            seen["mass"] = np.full(len(state), self._values["mass"])
        return seen

    def parameters(self) -> dict[str, float]:
        """The parameters in the mapping, in SI."""
        return dict(self._values)

    def with_parameters(self, values: Mapping[str, float]) -> FmuTruck:
        """The same FMU with other values."""
        return FmuTruck(self._instances, self._names, {**self._values, **values})

    def _seen(self, state: State) -> dict[str, Array]:
        out = np.array([row.out for row in state]).T
        return {link.name: link.ours(x) for link, x in zip(self._names.outputs[1:], out[1:], strict=True)}

    def _begun(self, speed: float, acceleration: float) -> Row:
        drive = self._drive(speed, acceleration)
        return Row(drive, 0, speed, acceleration, self._instances.begin(drive))

    def _drive(self, speed: float, acceleration: float) -> Drive:
        if not math.isfinite(speed):
            raise InputError("the speed to start at is no number; give recordings that have it")
        given = {"speed": speed, "acceleration": acceleration if math.isfinite(acceleration) else 0.0}
        links = [(link, given[name]) for name, link in self._names.start.items()]
        links += [
            (self._names.parameters[name], x)
            for name, x in self._values.items()
            if x != self._names.values[name]
        ]
        return Drive([*self._names.settings, *((link.variable, float(link.theirs(x))) for link, x in links)])

    def _stepped(self, row: Row, inputs: list[float]) -> Row:
        given = {"speed": 0.0, "acceleration": 0.0, "active": 0.0}
        if row.measured is not None:
            given = {"speed": row.measured[0], "acceleration": row.measured[1], "active": 1.0}
        measured = [float(link.theirs(given[name])) for name, link in self._names.measured.items()]
        drive, out = self._instances.step(row.drive, row.length, [*inputs, *measured])
        speed = float(self._names.outputs[0].ours(out[0]))
        acceleration = (speed - row.speed) / self.dt
        if not math.isfinite(speed):
            raise InputError(
                f"its speed is {speed} after {(row.length + 1) * self.dt:.4g} s: it diverged; give the "
                "mapping a smaller 'step', or look at the units of its inputs"
            )
        if row.length == 0 and abs(acceleration) > HARDEST:
            start = self._names.start["speed"].variable.name
            raise InputError(
                f"it is at {speed:.4g} m/s one step after it was to start at {row.speed:.4g}; look at "
                f"'start: speed' ({start}) and its unit"
            )
        return Row(drive, row.length + 1, speed, acceleration, out)

    def _forced(self, row: Row, speed: float, acceleration: float) -> Row:
        if math.isnan(speed) and math.isnan(acceleration):
            return row
        speed = row.speed if math.isnan(speed) else float(speed)
        acceleration = row.acceleration if math.isnan(acceleration) else float(acceleration)
        if self._names.measured:
            return replace(row, speed=speed, acceleration=acceleration, measured=(speed, acceleration))
        return Row(self._drive(speed, acceleration), 0, speed, acceleration, row.out)

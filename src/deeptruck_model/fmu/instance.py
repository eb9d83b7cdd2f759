"""One running instance of an FMU: a common interface to FMI 2 and 3, for numbers only."""

from __future__ import annotations

import ctypes
import tempfile
import zipfile
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from deeptruck_core import reading
from deeptruck_core.errors import InputError
from deeptruck_model.fmu.description import Description, Variable

KINDS = {  # of variables: what the FMI functions call them, and what they take
    2: {
        "Real": ("Real", ctypes.c_double),
        "Integer": ("Integer", ctypes.c_int),
        "Enumeration": ("Integer", ctypes.c_int),
        "Boolean": ("Boolean", ctypes.c_int),
    },
    3: {
        "Float64": ("Float64", ctypes.c_double),
        "Float32": ("Float32", ctypes.c_float),
        "Enumeration": ("Int64", ctypes.c_int64),
        "Boolean": ("Boolean", ctypes.c_bool),
        **{f"{u}Int{n}": (f"{u}Int{n}", getattr(ctypes, f"c_{u.lower()}int{n}"))
           for u in ("", "U") for n in (8, 16, 32, 64)},
    },
}  # fmt: skip
FLOATS = (ctypes.c_double, ctypes.c_float)


class Unpacked:
    """An FMU's files in a temporary folder, removed when the program ends."""

    def __init__(self, description: Description) -> None:
        from fmpy import extract

        self.description = description
        self._place = tempfile.TemporaryDirectory(prefix="deeptruck_fmu_")
        self.folder = Path(self._place.name)
        try:
            extract(str(description.file), str(self.folder))
        except (OSError, zipfile.BadZipFile, Exception) as error:
            said = reading.plain(str(error))
            raise InputError(f"it cannot be unpacked ({said}); export it again") from None


class Block:
    """Variables that are written or read together, with one call per type."""

    def __init__(self, fmu: Any, version: int, variables: Sequence[Variable]) -> None:
        self._fmu, self._size, self._three = fmu, len(variables), version == 3
        self._parts = []
        kinds = [KINDS[version][v.type] for v in variables]
        for kind, c in dict.fromkeys(kinds):
            at = [i for i, k in enumerate(kinds) if k == (kind, c)]
            references = (ctypes.c_uint * len(at))(*(variables[i].reference for i in at))
            put, get = (getattr(fmu, f"fmi{version}{verb}{kind}") for verb in ("Set", "Get"))
            self._parts.append((put, get, references, (c * len(at))(), at, c in FLOATS))

    def write(self, numbers: Sequence[float]) -> None:
        """Write these numbers to the FMU."""
        for put, _, references, values, at, real in self._parts:
            values[:] = [numbers[i] for i in at] if real else [round(numbers[i]) for i in at]
            self._call(put, references, values)

    def read(self) -> list[float]:
        """Read the present values of the variables."""
        out = [0.0] * self._size
        for _, get, references, values, at, _ in self._parts:
            self._call(get, references, values)
            for i, value in zip(at, values, strict=True):
                out[i] = float(value)
        return out

    def _call(self, function: Any, references: Any, values: Any) -> None:
        n = len(references)
        if self._three:
            function(self._fmu.component, references, n, values, n)
        else:
            function(self._fmu.component, references, n, values)


class Instance:
    """An instance. `start` may be called again at any time, to restart it; `step` advances it."""

    def __init__(
        self,
        unpacked: Unpacked,
        inputs: Sequence[Variable],
        outputs: Sequence[Variable],
        dt: float,
        substeps: int,
    ) -> None:
        self._d, self._words = unpacked.description, deque[str](maxlen=2)
        self._dt, self._substeps, self._steps = dt, substeps, 0
        self._fresh = self._resets = True
        with self._asked("instantiate"):
            self._fmu = self._made(unpacked.folder)
            self._instantiate()
        self._begins: dict[tuple[Variable, ...], Block] = {}  # a forced run may start at every step
        self._in, self._out = (Block(self._fmu, self._d.version, v) for v in (inputs, outputs))

    def _made(self, folder: Path) -> Any:
        import scipy.linalg  # noqa: F401  where an FMU in Python loads it first, the process aborts as it ends
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        kind = FMU2Slave if self._d.version == 2 else FMU3Slave
        return kind(
            guid=self._d.token,
            modelIdentifier=self._d.identifier,
            unzipDirectory=str(folder),
            instanceName=self._d.identifier,
        )

    def _instantiate(self) -> None:
        """Create the FMU instance; passing a logger keeps FMPy from printing the FMU's log."""
        if self._d.version == 3:
            self._fmu.instantiate(logMessage=lambda _, status, category, text: self._hear(status, text))
            return
        from fmpy import calloc, fmi2, free

        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(
            lambda _, name, status, __, text: self._hear(status, text)
        )
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
        with suppress(Exception):  # it fills in the words of a message where its library runs
            from fmpy.logging import addLoggerProxy

            addLoggerProxy(ctypes.byref(callbacks))
        self._fmu.instantiate(callbacks=callbacks)

    def _hear(self, status: int, text: bytes | None) -> None:
        if status > 0 and text:
            self._words.append(text.decode("utf-8", "replace"))

    def start(self, values: Sequence[tuple[Variable, float]]) -> list[float]:
        """Initialise the FMU with these start values and return its outputs."""
        if not self._fresh:
            self._begin_again()
        self._fresh, self._steps = False, 0
        variables, numbers = [v for v, _ in values], [x for _, x in values]
        begins = self._begins.get(tuple(variables))
        if begins is None:
            begins = self._begins[tuple(variables)] = Block(self._fmu, self._d.version, variables)
        with self._asked("initialise"):
            if self._d.version == 2:
                self._fmu.setupExperiment(startTime=0.0)
            begins.write(numbers)
            self._fmu.enterInitializationMode()
            self._fmu.exitInitializationMode()
            return self._out.read()

    def _begin_again(self) -> None:
        """Reset; if the FMU cannot, replace it by a new instance."""
        if self._resets:
            try:
                self._fmu.reset()
                return
            except Exception:
                self._resets = False
        with self._asked("be reset, nor made again, and so not"):
            self._free()
            self._instantiate()

    def step(self, numbers: Sequence[float]) -> list[float]:
        """Advance by dt with these inputs and return the outputs."""
        with self._asked("step"):
            self._in.write(numbers)
            for k in range(self._substeps):
                at = (self._steps * self._substeps + k) * self._dt
                self._fmu.doStep(at, self._dt)
            self._steps += 1
            return self._out.read()

    def save_state(self) -> tuple[Any, int]:
        """Save its whole state for `restore`; release it by `forget`."""
        with self._asked("give its state"):
            get = self._fmu.getFMUstate if self._d.version == 2 else self._fmu.getFMUState
            return get(), self._steps

    def restore(self, saved: tuple[Any, int]) -> None:
        """Restore a saved state."""
        with self._asked("take its state"):
            (self._fmu.setFMUstate if self._d.version == 2 else self._fmu.setFMUState)(saved[0])
            self._steps = saved[1]

    def forget(self, saved: tuple[Any, int]) -> None:
        """Release a saved state."""
        with suppress(Exception):
            (self._fmu.freeFMUstate if self._d.version == 2 else self._fmu.freeFMUState)(saved[0])

    def close(self) -> None:
        """End the instance; it may hold a licence."""
        with suppress(Exception):
            self._fmu.terminate()
        with suppress(Exception):
            self._free()

    def _free(self) -> None:
        getattr(self._fmu, f"fmi{self._d.version}FreeInstance")(self._fmu.component)

    @contextmanager
    def _asked(self, what: str) -> Iterator[None]:
        """Turns FMPy's exceptions into one line with the FMU's last log message."""
        try:
            yield
        except InputError:
            raise
        except Exception as error:
            own = f"; it says: {reading.plain(self._words[-1])}" if self._words else ""
            said = reading.plain(str(error)).rstrip(".")
            at = f" at {self._steps * self._substeps * self._dt:.4g} s" if what == "step" else ""
            raise InputError(f"it cannot {what}{at} ({said}){own}") from error

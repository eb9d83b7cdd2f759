"""Finds and makes an outside simulator.

`python:PACKAGE.MODULE:FACTORY[:ARGUMENTS.yaml]` is the return value of a function, called with the mapping in
the YAML file, or without arguments. The current directory is importable, as with `python -m`.
`fmu:MODEL.fmu[:MAPPING.yaml]` is a file, which is opened by the function registered for its scheme in
OPENERS.
"""

from __future__ import annotations

import hashlib
import importlib
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from deeptruck_core import reading
from deeptruck_core.errors import InputError
from deeptruck_core.imports.entry_points import registered

PYTHON, FMU = "python:", "fmu:"
SCHEMES = (PYTHON, FMU)
FORM = f"{PYTHON}PACKAGE.MODULE:FACTORY[:ARGUMENTS.yaml]"
FMU_FORM = f"{FMU}MODEL.fmu[:MAPPING.yaml]"
OPENERS = "deeptruck.simulator_files"  # entry points by scheme: from a path and a mapping to a simulator


@dataclass(frozen=True)
class Reference:
    """Source of a simulator. The hashes are SHA-256 of the present files; None without one."""

    text: str  # as given, with the scheme
    module: str  # '' for a file
    factory: str
    arguments: Path | None
    module_file: Path | None
    module_sha256: str | None
    arguments_sha256: str | None
    mapping: Mapping[Any, Any] | None = field(default=None, compare=False)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for a manifest."""
        return {
            "simulator": self.text,
            "module_file": None if self.module_file is None else str(self.module_file),
            "module_sha256": self.module_sha256,
            "arguments_file": None if self.arguments is None else str(self.arguments.absolute()),
            "arguments_sha256": self.arguments_sha256,
        }


def is_outside(text: str) -> bool:
    """Whether the text names a simulator by one of SCHEMES."""
    return text.startswith(SCHEMES)


def refer(text: str, file_at: Path | None = None, arguments_at: Path | None = None) -> Reference:
    """The reference of a text as FORM or FMU_FORM, without running any of its code.

    `file_at` and `arguments_at` are alternative paths of the FMU and the YAML file if they are not where the
    text says. Raises InputError for another form, a missing file, or arguments that are no mapping.
    """
    if text.startswith(FMU):
        return _file(text, file_at, arguments_at)
    module, _, rest = text.removeprefix(PYTHON).partition(":")
    factory, _, given = rest.partition(":")
    if not factory.isidentifier() or not all(part.isidentifier() for part in module.split(".")):
        raise InputError(f"{text} names no factory; give {FORM}")
    arguments, mapping = _arguments(given, arguments_at, FORM)
    file = _module_file(module, text)
    return Reference(text, module, factory, arguments, file, _sha256(file), _sha256(arguments), mapping)


def _file(text: str, file_at: Path | None, arguments_at: Path | None) -> Reference:
    before, ends, given = text.removeprefix(FMU).partition(".fmu:")
    file = _there(Path(f"{before}.fmu" if ends else before), file_at)
    reading.check_file(file, f"give {FMU_FORM}")
    arguments, mapping = _arguments(given, arguments_at, FMU_FORM)
    return Reference(text, "", file.name, arguments, file, _sha256(file), _sha256(arguments), mapping)


def _arguments(given: str, at: Path | None, form: str) -> tuple[Path, Mapping[Any, Any]] | tuple[None, None]:
    if not given:
        return None, None
    arguments = _there(Path(given), at)
    return arguments, reading.yaml_mapping(arguments, f"give {form}")


def _there(file: Path, otherwise: Path | None) -> Path:
    return otherwise if otherwise is not None and not file.exists() else file


def _module_file(module: str, named: str) -> Path | None:
    """The file of a module; None if it has none. Raises InputError if there is no such module."""
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    with asked(named, f"the package around {module}"):
        try:
            found = find_spec(module)
        except ModuleNotFoundError as error:
            if not f"{module}.".startswith(f"{error.name}."):
                raise  # a library that the package around it wants
            found = None
        except ValueError:  # a module that says of itself that it was made by hand
            found = None
    if found is None:
        said = f"{named}: there is no module {module}, neither from {here} on nor among what is installed"
        cure = "name it without '.py'" if module.endswith(".py") else "start where it can be imported"
        raise InputError(f"{said}; {cure}")
    return Path(found.origin) if found.origin and Path(found.origin).is_file() else None


def _sha256(file: Path | None) -> str | None:
    return None if file is None else hashlib.sha256(file.read_bytes()).hexdigest()


@contextmanager
def asked(named: str, what: str) -> Iterator[None]:
    """Turns an exception in foreign code into one line, with the exception as its cause."""
    try:
        yield
    except InputError as error:
        said = reading.plain(str(error), reading.MOST_SAID)
        raise InputError(said if named in said else f"{named}: {said}") from error
    except (Exception, SystemExit) as error:
        said = reading.plain(str(error)) or "without a word"
        where = _where(error)
        raise InputError(f"{named}: {what} raised {type(error).__name__}{where} ({said}); mend it") from error


def _where(error: BaseException) -> str:
    if isinstance(error, SyntaxError) and error.filename:
        return f" at {Path(error.filename).name}:{error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if not f.filename.startswith("<") and Path(f.filename).parent != HERE]
    return f" at {Path(own[-1].filename).name}:{own[-1].lineno}" if own else ""


HERE = Path(__file__).parent


def made(reference: Reference) -> Any:
    """The return value of the factory, unchecked. Raises InputError if it cannot be made."""
    named = reference.text
    if not reference.module:
        return _opened(reference)
    with asked(named, f"importing {reference.module}"):
        module = importlib.import_module(reference.module)
    factory: Callable[..., Any] | None = getattr(module, reference.factory, None)
    if factory is None or not callable(factory):
        what = "is no function or class" if hasattr(module, reference.factory) else "is not there"
        raise InputError(
            f"{named}: {reference.factory} {what} in {reference.module}; name what returns the simulator"
        )
    with asked(named, f"{reference.factory}()"):
        return factory() if reference.mapping is None else factory(dict(reference.mapping))


def _opened(reference: Reference) -> Any:
    """The object that the opener registered for the file's scheme makes."""
    scheme = reference.text.partition(":")[0]
    opener = registered(OPENERS).get(scheme)
    if opener is None:
        raise InputError(f"{reference.text}: nothing installed opens it; install deeptruck again")
    with asked(reference.text, "opening it"):
        return opener.load()(reference.module_file, reference.mapping)

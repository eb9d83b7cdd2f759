"""Where an outside simulator comes from: `python:PACKAGE.MODULE:FACTORY[:ARGUMENTS.yaml]`, found and called.

The factory is called with the mapping of the YAML file, or with nothing. The current directory is importable,
as with `python -m`.
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

from deeptruck_model import reading
from deeptruck_model.errors import InputError

SCHEME = "python:"
FORM = f"{SCHEME}PACKAGE.MODULE:FACTORY[:ARGUMENTS.yaml]"


@dataclass(frozen=True)
class Reference:
    """Where a simulator comes from. The hashes are SHA-256 of the files as they are now; None without one."""

    text: str  # as given, with the scheme
    module: str
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


def refer(text: str, arguments_at: Path | None = None) -> Reference:
    """What PACKAGE.MODULE:FACTORY[:ARGUMENTS.yaml] names, before anything of the module is run.

    `arguments_at` is where the arguments are looked for if they are not where the text says. Raises
    InputError for another form, a module that is not found, or arguments that are no mapping.
    """
    named = SCHEME + text
    module, _, rest = text.partition(":")
    factory, _, given = rest.partition(":")
    if not factory.isidentifier() or not all(part.isidentifier() for part in module.split(".")):
        raise InputError(f"{named} names no factory; give {FORM}")
    arguments = Path(given) if given else None
    if arguments is not None and arguments_at is not None and not arguments.exists():
        arguments = arguments_at
    mapping = None if arguments is None else reading.yaml_mapping(arguments, f"give {FORM}")
    file = _module_file(module, named)
    return Reference(named, module, factory, arguments, file, _sha256(file), _sha256(arguments), mapping)


def _module_file(module: str, named: str) -> Path | None:
    """The file of a module; None where it has none. Raises InputError where there is no such module."""
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
    """One line in place of whatever somebody else's code raises, which stays as its cause."""
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
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if not f.filename.startswith("<") and Path(f.filename).parent != HERE]
    return f" at {Path(own[-1].filename).name}:{own[-1].lineno}" if own else ""


HERE = Path(__file__).parent


def made(reference: Reference) -> Any:
    """What the factory returns, unlooked at. Raises InputError where it cannot be had."""
    named = reference.text
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

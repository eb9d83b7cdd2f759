"""Checks of a user's file before a reader trusts it. Standard library and YAML only.

JSON, YAML and CSV have no checksum: a changed digit is detected only if a manifest in the same folder has the
SHA-256. Detectable errors (a pipe in place of a file, binary data, values that no reader expects) are refused
with one line that names the file and the remedy.
"""

from __future__ import annotations

import difflib
import hashlib
import json
import os
import shlex
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any

from deeptruck_core.errors import InputError

SHOWN = 20  # names that an error lists
LONGEST = 200  # characters that a library may say in one of our lines
LONGEST_CELL = 43  # likewise, of a cell that a message quotes
MOST_SAID = 500  # characters of one of our own lines about a file
SAVE_AGAIN = "train or save the simulator again"
LARGEST = 16 * 2**20  # bytes of a text file that people or our commands write
DEEPEST = 100  # nested levels of a YAML file
MOST_NODES = 1_000_000  # values in a YAML file, an alias counted as often as it stands


def typed(path: str | Path) -> str:
    """A path as it is typed into a shell, in double quotes where it has blanks."""
    text = str(path)
    if shlex.quote(text) == text:
        return text
    return shlex.quote(text) if set(text) & set('"$`\\!') else f'"{text}"'


def check_file(path: Path, cure: str) -> None:
    """Raises InputError if `path` is missing, a folder, a pipe or device, or may not be read.

    The message ends with `cure`. Nothing is opened, because opening a pipe without a writer would block.
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        raise InputError(f"{path} cannot be read: it does not exist; {cure}") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read: {_why(error)}; {cure}") from None
    if stat.S_ISDIR(mode):
        raise InputError(f"{path} is a folder, not a file; {cure}")
    if not stat.S_ISREG(mode):
        raise InputError(f"{path} is a pipe or device, not a file; {cure}")
    if not os.access(path, os.R_OK):
        raise InputError(f"{path} may not be read; change its permissions, or {cure}")


def text(path: Path, cure: str) -> str:
    """A text file in UTF-8. Raises InputError as check_file does, and for one that is no text."""
    check_file(path, cure)
    try:
        if path.stat().st_size > LARGEST:
            raise InputError(f"{path} is larger than {LARGEST // 2**20} MiB; {cure}")
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is damaged or no text ({_why(error)}); {cure}") from None


def sha256(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check_saved(folder: Path, manifest: str, digests: object, cure: str) -> None:
    """Raises InputError if the SHA-256 of a file in `folder` differs from that in its manifest.

    `digests` maps names to digests; None, as in folders of earlier versions, is not checked. For files that
    have just been read, whose formats have no checksum.
    """
    if digests is None:
        return
    if not isinstance(digests, dict):
        raise InputError(f"{folder / manifest} is damaged (sha256 is no table); {cure}")
    for name, digest in digests.items():
        path = folder / Path(name).name
        if path.is_file() and sha256(path) != digest:
            raise InputError(f"{path} is damaged or of another save: {manifest} has another SHA-256; {cure}")


def json_object(path: Path, cure: str) -> dict[str, Any]:
    """A JSON file that holds one object. Raises InputError if it is missing or holds something else."""
    content = text(path, cure)
    try:
        data = json.loads(content)
    except (ValueError, RecursionError) as error:  # ValueError: also a number of thousands of digits
        raise InputError(f"{path} is damaged ({_why(error)}); {cure}") from None
    if not isinstance(data, dict):
        raise InputError(f"{path} is damaged (it holds no JSON object); {cure}")
    return data


def yaml_mapping(path: Path, cure: str) -> dict[Any, Any]:
    """A YAML file that holds one mapping. Raises InputError if it is missing or holds something else."""
    import yaml

    content = text(path, cure)
    try:
        data = parse_yaml(content)
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # ValueError: a date or number that is none
        raise InputError(f"{path} is not valid YAML ({_why(error)}); {cure}") from None
    if not isinstance(data, dict):
        raise InputError(f"{path} must hold 'key: value' pairs at its top level; {cure}")
    if _nodes(data, MOST_NODES) <= 0:
        raise InputError(f"{path} holds too much, or an alias of itself; {cure}")
    return data


def package_yaml(folder: str, name: str) -> Any:
    """The content of a YAML file in a package."""
    return parse_yaml(resources.files(folder).joinpath(name).read_text(encoding="utf-8"))


def parse_yaml(content: str) -> Any:
    """The content of a YAML text, by libyaml where PyYAML has it, which is five times as fast.

    Raises yaml.YAMLError; ValueError for an invalid date or number; RecursionError for more than DEEPEST
    nested levels, of which some thousands would end the process in libyaml.
    """
    import yaml

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    depth = 0
    for event in yaml.parse(content, loader):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            raise RecursionError(f"more than {DEEPEST} nested levels")
    return yaml.load(content, loader)


def number(value: Any, name: str, source: Path | str, low: float, high: float) -> float:
    """A number of a manifest. Raises InputError if it is not a number, NaN, or not from `low` to `high`."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        said = plain(repr(value))
        raise InputError(f"{source} is damaged: {name} is {said}, not {low:g} to {high:g}; {SAVE_AGAIN}")
    return float(value)


def _nodes(value: Any, left: int, depth: int = 0) -> int:
    """`left` minus the number of values in `value`; 0 if there are more, or if they are nested too deeply."""
    left -= 1
    if depth > DEEPEST:
        return 0
    if isinstance(value, Mapping):
        value = [*value.keys(), *value.values()]
    for item in value if isinstance(value, list | tuple | set) else ():
        if left <= 0:
            return 0
        left = _nodes(item, left, depth + 1)
    return max(left, 0)


@contextmanager
def of(path: Path | str) -> Iterator[None]:
    """Prefix every InputError of the block with `path`, and shorten long quotations of a damaged file."""
    try:
        yield
    except InputError as error:
        said = plain(str(error), MOST_SAID)
        raise InputError(said if str(path) in said else f"{path}: {said}") from None


def why(error: BaseException, longest: int = LONGEST) -> str:
    """The message of a library's error as plain text, or its name if it has none."""
    return plain(str(error), longest) or type(error).__name__


def plain(said: str, longest: int = LONGEST) -> str:
    """A library's message as one line without control characters, shortened if it is long."""
    line = " ".join("".join(c if c.isprintable() else " " for c in said).split())
    return line if len(line) <= longest else f"{line[: longest - 3]}..."


def quoted(cell: object) -> str:
    """A cell of a table in quotation marks, on one line and shortened."""
    return f"'{plain(str(cell), LONGEST_CELL)}'"


def _why(error: BaseException) -> str:
    return plain(getattr(error, "strerror", None) or str(error)) or type(error).__name__


def near(name: str, known: Sequence[str]) -> str:
    """The end of an error message: the known names that begin as `name` does, else the nearest, else
    the first known names."""
    stem = name.rstrip("s")
    begins = [one for one in known if len(stem) > 2 and one.startswith(stem)]
    guesses = begins[:SHOWN] or difflib.get_close_matches(name[:80], known, n=3, cutoff=0.6)
    if guesses:
        return f"did you mean {' or '.join(guesses)}?"
    more = f" and {len(known) - SHOWN} more" if len(known) > SHOWN else ""
    return f"known: {', '.join(known[:SHOWN])}{more}"

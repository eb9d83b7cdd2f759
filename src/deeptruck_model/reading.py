"""What every reader does before it trusts a file of the user's, in one place. Standard library and YAML only.

JSON, YAML and CSV have no checksum: a digit that changed on a disk reads as another number, and nobody can
see it, unless a manifest in the same folder has the SHA-256. What can be seen (a pipe in the place of a
file, text that is none, values that no reader expects) is refused with one line that names the file and says
how to mend it.
"""

from __future__ import annotations

import difflib
import hashlib
import json
import math
import os
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from deeptruck_model.errors import InputError

SHOWN = 20  # names that an error lists
LONGEST = 200  # characters that a library may say in one of our lines
MOST_SAID = 500  # characters of one of our own lines about a file
SAVE_AGAIN = "train or save the simulator again"
LARGEST = 16 * 2**20  # bytes of a text file that people or our commands write
MOST_NODES = 1_000_000  # values in a YAML file, an alias counted as often as it stands


def check_file(path: Path, cure: str) -> None:
    """Raises InputError where `path` is missing, a folder, a pipe or device, or may not be read.

    It ends with `cure`. Nothing is opened: a pipe without a writer would never answer.
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
    """A text file in UTF-8. Raises InputError as check_file, and for one that is no text."""
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
    """Raises InputError where a file in `folder` is not the one whose SHA-256 its manifest gives.

    `digests` maps names to digests; None, as in folders of earlier versions, is not checked. For files that a
    reader has just read: the formats have no checksum, so a changed bit would be another number in silence.
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
    """A JSON file that holds one object. Raises InputError where it is missing or something else."""
    content = text(path, cure)
    try:
        data = json.loads(content)
    except (ValueError, RecursionError) as error:  # ValueError: also a number of thousands of digits
        raise InputError(f"{path} is damaged ({_why(error)}); {cure}") from None
    if not isinstance(data, dict):
        raise InputError(f"{path} is damaged (it holds no JSON object); {cure}")
    return data


def yaml_mapping(path: Path, cure: str) -> dict[Any, Any]:
    """A YAML file that holds one mapping. Raises InputError where it is missing or something else."""
    import yaml

    content = text(path, cure)
    try:
        data = yaml.safe_load(content)
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # ValueError: a date or number that is none
        raise InputError(f"{path} is not valid YAML ({_why(error)}); {cure}") from None
    if not isinstance(data, dict):
        raise InputError(f"{path} must hold 'key: value' pairs at its top level; {cure}")
    if _nodes(data, MOST_NODES) <= 0:
        raise InputError(f"{path} holds too much, or an alias of itself; {cure}")
    return data


def number(value: Any, name: str, source: Path | str, low: float, high: float) -> float:
    """A number of a manifest. Raises InputError where it is none, NaN, or not from `low` to `high`."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        said = plain(repr(value))
        raise InputError(f"{source} is damaged: {name} is {said}, not {low:g} to {high:g}; {SAVE_AGAIN}")
    return float(value)


def _nodes(value: Any, left: int, depth: int = 0) -> int:
    """`left` less the values in `value`; 0 where they are more, or lie too deep."""
    left -= 1
    if depth > 100:
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
    """Put `path` before every InputError of the block, and cut what quotes too much of a damaged file."""
    try:
        yield
    except InputError as error:
        said = plain(str(error), MOST_SAID)
        raise InputError(said if str(path) in said else f"{path}: {said}") from None


def plain(said: str, longest: int = LONGEST) -> str:
    """What a library said, as one line without control characters, cut where it is long."""
    line = " ".join("".join(c if c.isprintable() else " " for c in said).split())
    return line if len(line) <= longest else f"{line[: longest - 3]}..."


def number_in_cell(cell: str, where: str, cure: str) -> float:
    """The number in a cell of a table of ours. Raises InputError that begins with `where`, which names the
    cell, and ends with `cure`, for another text and for NaN and infinity."""
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{where} is '{plain(cell, 40)}', which is no number; {cure}")
    return value


def _why(error: BaseException) -> str:
    return plain(getattr(error, "strerror", None) or str(error)) or type(error).__name__


def near(name: str, known: Sequence[str]) -> str:
    """The end of an error message: what the writer may have meant, else the first names that are known."""
    guesses = difflib.get_close_matches(name[:80], known, n=3, cutoff=0.6)
    if guesses:
        return f"did you mean {' or '.join(guesses)}?"
    more = f" and {len(known) - SHOWN} more" if len(known) > SHOWN else ""
    return f"known: {', '.join(known[:SHOWN])}{more}"

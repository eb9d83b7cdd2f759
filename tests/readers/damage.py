"""Damaged copies of a valid file, and a judge of what its reader makes of them.

A reader may give what the valid file gives, or refuse with one line that names the file. Where the format
has a checksum over what is read, it may not give anything else. Where it has none (CSV, candump text, YAML,
JSON), a changed digit is a valid file of other content, and only crashes are defects.
"""

from __future__ import annotations

import resource
import signal
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from deeptruck_core.errors import InputError as ModelError
from truck_bridge.errors import InputError as BridgeError

SECONDS = 10.0  # after which a reader hangs
BYTES = 2 * 2**30  # that a reader may allocate beside what the process has
LONGEST = 600  # characters of one line to a user, beside the path
AS_BEFORE, OTHER, REFUSED = "as before", "other", "refused"
_EXTREMES = [
    b"\xff" * 8,
    b"\0" * 8,
    b"\xff" * 7 + b"\x7f",
    b"\0" * 4 + b"\1" + b"\0" * 3,
    b"\xff\xff\xff\x7f",
]
_TEXT = [
    b"9" * 30, b"9" * 400, b"9" * 5000, b"-", b"nan", b"1e999", b".", b"\n", b'"', b"{", b"[", b"&a ", b"*a",
    b"[" * 3000, b": ", b"\0", b"\xff", b"null", b"0x", b"1.2.3", b"2001-99-99", "\u0663".encode(), b"#",
    b",",
]  # fmt: skip


@dataclass(frozen=True)
class Reader:
    """A kind of file. `make` writes a valid one into a folder and returns it; `read` gives what is in it.

    `checked` says that the format has checksums over all that `read` gives.
    """

    name: str
    make: Callable[[Path], Path]
    read: Callable[[Path], Any]
    checked: bool = False


class Hang(BaseException):
    """Not an Exception, so that no reader catches it."""


def mutants(data: bytes, count: int, seed: int) -> Iterator[bytes]:
    """Bit flips, cuts, inserted and overwritten bytes, swapped and doubled blocks; the same for a seed."""
    random = Random(seed)
    for number in range(count):
        yield _KINDS[number % len(_KINDS)](data, random)


def _flip(data: bytes, random: Random) -> bytes:
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 1, 2, 8))):
        changed[random.randrange(len(data))] ^= 1 << random.randrange(8)
    return bytes(changed)


def _cut(data: bytes, random: Random) -> bytes:
    at = random.randrange(len(data))
    return data[:at] if random.random() < 0.5 else data[:at] + data[at + random.randrange(1, 40) :]


def _insert(data: bytes, random: Random) -> bytes:
    at = random.randrange(len(data) + 1)
    return data[:at] + random.choice([random.randbytes(random.randrange(1, 20)), *_TEXT]) + data[at:]


def _overwrite(data: bytes, random: Random) -> bytes:
    new = random.choice([*_EXTREMES, random.randbytes(4), *_TEXT])
    at = random.randrange(len(data))
    return data[:at] + new + data[at + len(new) :]


def _swap(data: bytes, random: Random) -> bytes:
    a, b, c = sorted(random.randrange(len(data)) for _ in range(3))
    return data[:a] + data[b:c] + data[a:b] + data[c:]


def _double(data: bytes, random: Random) -> bytes:
    a, b = sorted(random.randrange(len(data)) for _ in range(2))
    return data[:b] + data[a:b] + data[b:]


_KINDS = (_flip, _cut, _insert, _overwrite, _swap, _flip, _double, _overwrite)


def fuzz(reader: Reader, folder: Path, count: int, seed: int = 0) -> tuple[Counter[str], list[str]]:
    """What became of `count` damaged copies, by outcome, and the defects of the reader."""
    file = reader.make(folder)
    valid = file.read_bytes()
    expected = reader.read(file)
    outcomes: Counter[str] = Counter()
    defects = []
    for number, data in enumerate(mutants(valid, count, seed)):
        file.write_bytes(data)
        outcome = judge(reader, file, expected)
        outcomes[outcome if outcome in (AS_BEFORE, OTHER, REFUSED) else "defect"] += 1
        if outcome not in (AS_BEFORE, OTHER, REFUSED):
            defects.append(f"{reader.name} {number}: {outcome}")
        elif outcome == OTHER and reader.checked:
            defects.append(f"{reader.name} {number}: another result without a word")
    return outcomes, defects


def judge(reader: Reader, file: Path, expected: Any) -> str:
    """AS_BEFORE, OTHER or REFUSED; else the defect, in words."""
    try:
        with limited(), warnings.catch_warnings():
            warnings.simplefilter("error")
            found = reader.read(file)
    except (ModelError, BridgeError) as error:
        return _judge_words(error, file)
    except Hang:
        return f"no end within {SECONDS:g} s"
    except BaseException as error:
        return f"{type(error).__name__}: {error}"[:300]
    return AS_BEFORE if same(found, expected) else OTHER


def _judge_words(error: BaseException, file: Path) -> str:
    text = str(error)
    if _of_memory(error):
        return f"more than {BYTES} bytes asked for: {text}"
    if not text.isprintable():
        return f"not one line of plain text: {text!r}"
    if file.stem not in text and file.parent.name not in text:
        return f"does not name the file: {text}"
    if len(text.replace(str(file), "")) > LONGEST:
        return f"{len(text)} characters: {text}"
    return REFUSED


def _of_memory(error: BaseException | None) -> bool:
    return error is not None and (isinstance(error, MemoryError) or _of_memory(error.__context__))


def same(a: Any, b: Any) -> bool:
    """Equal values, arrays included, NaN equal to NaN."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.shape == b.shape and a.tobytes() == b.tobytes()
    return bool(a == b) or (a != a and b != b)


@contextmanager
def limited() -> Iterator[None]:
    """SECONDS and BYTES for what is inside."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    before = signal.signal(signal.SIGALRM, _stop)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + BYTES, hard))
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def _stop(*_: object) -> None:
    raise Hang

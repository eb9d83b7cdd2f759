"""Every cure that a refused bag names, followed as written, gives the values or another true refusal."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from foreign_bags import bag_of, drive_messages

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import read, repair


def cut(share: float) -> Callable[[bytes], bytes]:
    return lambda data: data[: int(share * len(data))]


def swapped(at: float, by: bytes) -> Callable[[bytes], bytes]:
    return lambda data: data[: (k := int(at * len(data)))] + by + data[k + len(by) :]


ANEW = r"copy it anew from where it was recorded"
REPAIR = r"kept by 'deeptruck-model repair (\S+)'"
DAMAGES = {
    "nothing left": (lambda data: b"", ANEW),
    "a table": (lambda data: b"time,speed\n1,2\n" * 100, ANEW),
    "the head alone": (lambda data: data[:12], REPAIR),
    "half": (cut(0.5), REPAIR),
    "all but the end": (cut(0.98), REPAIR),
    "a record's length": (lambda data: data[:9] + struct.pack("<Q", 2**40) + data[17:], REPAIR),
    "zeros at the end": (lambda data: data[:-8] + bytes(8), REPAIR),
    "zeros in the middle": (swapped(0.5, bytes(64)), None),
    "more behind the end": (lambda data: data + data[-200:], REPAIR),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_cure_that_is_followed_gives_what_was_driven(tmp_path: Path, damage: str) -> None:
    bag = bag_of(tmp_path / "bag", drive_messages())
    (file,) = bag.glob("*.mcap")
    spoil, says = DAMAGES[damage]
    file.write_bytes(spoil(file.read_bytes()))
    refused = _refused(bag)
    if says is None and not refused:
        return  # not in a record that is read
    assert re.search(says or f"{ANEW}|{REPAIR}", refused), refused
    if (named := re.search(REPAIR, refused)) is None:
        return
    try:
        assert repair(Path(named[1])) is not None
    except InputError as error:
        assert "beyond repair" in str(error) or "cannot" in str(error) or "record anew" in str(error)
        return
    again = _refused(bag)
    assert not again or "holds no message" in again


def test_what_has_lost_its_file_or_its_metadata(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", drive_messages())
    (file,) = bag.glob("*.mcap")
    elsewhere = file.rename(tmp_path / "elsewhere.mcap")
    assert re.search(rf"it has lost {file.name}\); {ANEW}", _refused(bag))
    elsewhere.rename(file)
    for text in ("a: [1", "- " * 100_000):  # more levels than a recursive parser in C survives
        (bag / "metadata.yaml").write_text(text)
        assert "remove it and mend the bag with 'deeptruck-model repair'" in _refused(bag)
    (bag / "metadata.yaml").unlink()
    assert "mend it with 'deeptruck-model repair" in _refused(bag)
    assert repair(bag) is not None and not _refused(bag)


def _refused(bag: Path) -> str:
    """Why the bag is refused, in one line; else '' and its speeds are a beginning of those driven."""
    try:
        (recording,) = read(bag)
    except InputError as error:
        assert "\n" not in str(error)
        return str(error)
    speed = recording.channels["speed"]
    np.testing.assert_allclose(speed, 0.1 * np.arange(len(speed)), atol=1e-6)
    return ""

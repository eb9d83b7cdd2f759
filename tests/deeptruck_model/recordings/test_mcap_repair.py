from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import pytest
from counted_bags import contents, fill, payload
from mcap.opcode import Opcode
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from deeptruck_core.errors import InputError
from deeptruck_core.files import Result
from deeptruck_model.recordings import CrashSafeWriter, mcap_repair, read, repair

KIND = Result("a bag of this test")


def torn_bag(path: Path) -> tuple[Path, bytes]:
    """A bag whose last chunk is torn, with what belongs to the user beside it; the file's bytes."""
    with CrashSafeWriter(path, custom_data={"deeptruck.x": "1"}) as writer:
        fill(writer, range(50))
        writer.flush()
        fill(writer, range(50, 100))
    (file,) = path.glob("*.mcap")
    data = file.read_bytes()
    chunk = data.rindex(payload(99))
    file.write_bytes(data[: chunk + 4])
    (path / "notes.txt").write_text("mine")
    return file, data[: chunk + 4]


def test_a_repair_keeps_what_it_cuts_off_and_touches_nothing_else(tmp_path: Path) -> None:
    file, data = torn_bag(tmp_path / "bag")
    (tmp_path / "bag" / ".metadata.yaml.tmp").write_text("mine")
    old = (tmp_path / "bag" / "metadata.yaml").read_bytes()
    said = repair(tmp_path / "bag")
    assert said is not None and "the torn end is in bag_0.mcap.cut" in said
    torn = (tmp_path / "bag" / "bag_0.mcap.cut").read_bytes()
    assert torn and data.endswith(torn) and payload(60) in torn
    assert file.read_bytes().startswith(data[: -len(torn)])
    assert (tmp_path / "bag" / "metadata.yaml.before").read_bytes() == old
    assert (tmp_path / "bag" / "notes.txt").read_text() == "mine"
    assert (tmp_path / "bag" / ".metadata.yaml.tmp").read_text() == "mine"
    names = (
        ".metadata.yaml.tmp",
        "bag_0.mcap",
        "bag_0.mcap.cut",
        "metadata.yaml",
        "metadata.yaml.before",
        "notes.txt",
    )
    assert sorted(p.name for p in (tmp_path / "bag").iterdir()) == list(names)
    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.readers[0].storage.metadata.custom == {"deeptruck.x": "1"}  # type: ignore[union-attr]
    assert contents(tmp_path / "bag") == {"/a": list(range(50)), "/b": list(range(50))}


@pytest.mark.parametrize("step", ["_finish", "_kept", "_describe"])
@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(28, "No space left on device")])
def test_a_repair_that_ends_anywhere_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, error: BaseException
) -> None:
    _, data = torn_bag(tmp_path / "bag")

    def fails(*_: object) -> None:
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(mcap_repair, step, fails)
        with pytest.raises((KeyboardInterrupt, InputError)):
            repair(tmp_path / "bag")
    kept = b"".join(p.read_bytes() for p in sorted((tmp_path / "bag").glob("*.mcap*")))
    assert payload(60) in kept and payload(10) in kept and len(kept) >= len(data)
    assert repair(tmp_path / "bag") is not None
    assert contents(tmp_path / "bag") == {"/a": list(range(50)), "/b": list(range(50))}
    assert (tmp_path / "bag" / "notes.txt").read_text() == "mine"
    assert payload(60) in (tmp_path / "bag" / "bag_0.mcap.cut").read_bytes()


def test_a_link_is_not_turned_into_a_file(tmp_path: Path) -> None:
    _, data = torn_bag(tmp_path / "elsewhere")
    (tmp_path / "bag").mkdir()
    link, target = tmp_path / "bag" / "bag_0.mcap", tmp_path / "target.mcap"
    target.write_bytes(data)
    link.symlink_to(target)
    with pytest.raises(
        InputError, match=r"bag_0\.mcap is a symbolic link.* repair what it points to, .*target"
    ):
        repair(tmp_path / "bag")
    assert link.is_symlink() and target.read_bytes() == data
    assert [p.name for p in link.parent.iterdir()] == ["bag_0.mcap"]


def test_a_description_that_is_a_link_stays_one(tmp_path: Path) -> None:
    file, data = torn_bag(tmp_path / "bag")
    link, target = tmp_path / "bag" / "metadata.yaml", tmp_path / "mine.yaml"
    link.rename(target)
    link.symlink_to(target)
    before = target.read_bytes()
    with pytest.raises(InputError, match=r"metadata\.yaml is a symbolic link.* repair what it points to"):
        repair(tmp_path / "bag")
    assert link.is_symlink() and target.read_bytes() == before and file.read_bytes() == data


def finished_bag(bag: Path) -> Path:
    """A bag that its recorder has signed; its file."""
    with KIND.replacing(bag) as draft, CrashSafeWriter(draft, file_stem="bag", into=True) as writer:
        fill(writer, range(50))
    return bag / "bag_0.mcap"


def test_a_bag_that_only_lost_its_description_is_still_its_recorders(tmp_path: Path) -> None:
    bag = finished_bag(tmp_path / "bag").parent
    before = contents(bag)
    (bag / "metadata.yaml").unlink()
    said = repair(bag)
    assert said is not None and "nothing was lost" in said and contents(bag) == before
    KIND.check(bag, overwrite=True)


def test_a_bag_that_is_still_written_is_not_repaired(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, data = torn_bag(tmp_path / "bag")
    finish = mcap_repair._finish

    def meanwhile(*given: Any) -> None:
        finish(*given)
        with file.open("ab") as stream:
            stream.write(b"more")

    monkeypatch.setattr(mcap_repair, "_finish", meanwhile)
    with pytest.raises(InputError, match="is still being written"):
        repair(tmp_path / "bag")
    assert file.read_bytes() == data + b"more"


def records(data: bytes) -> list[tuple[int, int, int]]:
    """(opcode, place, length of the content) of the records of an unfinished file."""
    found, at = [], 8
    while at < len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        found.append((opcode, at, length))
        at += 9 + length
    return found


@pytest.mark.parametrize(
    ("record", "byte", "becomes"),
    [
        (Opcode.CHUNK, 0, Opcode.FOOTER),
        (Opcode.CHUNK, 0, Opcode.MESSAGE_INDEX),
        (Opcode.CHUNK, 9 + 39, 1),  # of the length of what is in it
        (Opcode.CHUNK, 9 + 200, 255),
        (Opcode.MESSAGE_INDEX, 0, Opcode.DATA_END),
        (Opcode.MESSAGE_INDEX, 8, 1),  # of its length
        (Opcode.MESSAGE_INDEX, 9, 77),  # of its channel
        (Opcode.MESSAGE_INDEX, 9 + 14, 255),  # of where a message is
        (Opcode.METADATA, 9 + 5, 255),
    ],
)
def test_a_flipped_byte_loses_nothing(tmp_path: Path, record: int, byte: int, becomes: int) -> None:
    """Each message is in the repaired bag, or in what is kept beside it; what is repaired can be read."""
    writer = CrashSafeWriter(tmp_path / "bag", custom_data={"deeptruck.x": "1"})
    for begin in range(0, 50, 10):
        fill(writer, range(begin, begin + 10))
        writer.flush()
    data = bytearray(writer.file.read_bytes())
    places = [at for opcode, at, _ in records(bytes(data)) if opcode == record]
    data[places[len(places) // 2] + byte] = becomes
    writer.file.write_bytes(data)
    assert repair(tmp_path / "bag") is not None
    kept = b"".join(path.read_bytes() for path in (tmp_path / "bag").glob("*.mcap*"))
    assert all(kept.count(payload(count)) >= 1 for count in range(50))
    with writer.file.open("rb") as stream:
        by_index = sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages())
    assert by_index == sum(map(len, contents(tmp_path / "bag").values()))


@pytest.mark.parametrize("described", [True, False])
@pytest.mark.parametrize("joined", [True, False])
def test_what_stands_behind_the_end_of_a_file_is_kept(tmp_path: Path, described: bool, joined: bool) -> None:
    """Two files that were joined, or a note at the end of one: the first is kept, the rest is set aside."""
    with CrashSafeWriter(tmp_path / "bag") as writer:
        fill(writer, range(50))
    (file,) = (tmp_path / "bag").glob("*.mcap")
    whole = file.read_bytes()
    behind = whole if joined else b"notes of the driver"
    file.write_bytes(whole + behind)
    if not described:
        (tmp_path / "bag" / "metadata.yaml").unlink()
    said = repair(tmp_path / "bag")
    assert said is not None and "the torn end is in bag_0.mcap.cut" in said
    assert (tmp_path / "bag" / "bag_0.mcap.cut").read_bytes().endswith(behind)
    assert contents(tmp_path / "bag") == {"/a": list(range(50)), "/b": list(range(50))}
    assert repair(tmp_path / "bag") is None


def test_what_a_reader_calls_torn_is_repaired(tmp_path: Path) -> None:
    """A footer that leads to another place than the index: readers refuse the file and name this command."""
    file = finished_bag(tmp_path / "bag")
    data = bytearray(file.read_bytes())
    (summary_start,) = struct.unpack_from("<Q", data, len(data) - 28)
    struct.pack_into("<Q", data, len(data) - 28, summary_start + 1)
    file.write_bytes(data)
    with pytest.raises(InputError, match="repair"):
        read(tmp_path / "bag")
    said = repair(tmp_path / "bag")
    assert said is not None and "nothing was lost" in said
    assert contents(tmp_path / "bag") == {"/a": list(range(50)), "/b": list(range(50))}

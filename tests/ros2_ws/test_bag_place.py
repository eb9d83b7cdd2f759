"""Where a run records: an older bag waits beside the new one, and nothing of the user's is lost."""

from __future__ import annotations

from pathlib import Path

import pytest

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_model.recordings import CrashSafeWriter
from deeptruck_nodes.bag_place import BAG, claimed, is_whole


def recorded(bag: Path, says: str = "old") -> None:
    """What the recorder does."""
    writer = CrashSafeWriter(bag, file_stem=files.final(bag).name, custom_data={"says": f'"{says}"'})
    with claimed(bag):
        writer.close()


def content(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_a_bag_of_ours_is_replaced_once_the_new_one_is_whole(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    recorded(bag)
    old = content(bag)
    with pytest.raises(InputError, match=r"a recorded bag already; choose another --record, or add --over"):
        BAG.check(bag)
    with BAG.recording(bag, overwrite=True, whole=is_whole) as newer:
        assert not newer.exists() and content(bag) == old
        recorded(newer, "new")
        assert content(bag) == old
    assert [p.name for p in tmp_path.iterdir()] == ["bag"] and content(bag) != old
    assert content(bag).keys() == old.keys()  # its file has the bag's name


@pytest.mark.parametrize("name", ["notes.txt", "sub/notes.txt", "later_0.mcap"])
def test_what_a_user_puts_into_a_bag_while_it_is_recorded_is_never_replaced(
    tmp_path: Path, name: str
) -> None:
    bag = tmp_path / "bag"
    writer = CrashSafeWriter(bag, file_stem="bag")
    with claimed(bag):
        (bag / name).parent.mkdir(exist_ok=True)
        (bag / name).write_text("mine")
        writer.close()
    with pytest.raises(InputError, match=f"bag holds {name.partition('/')[0]}.*no part of a recorded bag"):
        BAG.check(bag, overwrite=True)
    assert (bag / name).read_text() == "mine"


def test_an_empty_folder_may_become_the_bag(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    with BAG.recording(bag, overwrite=False, whole=is_whole):
        recorded(bag)
    assert [p.name for p in tmp_path.iterdir()] == ["bag"]


def test_a_place_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="choose another --record"):
        BAG.check(tmp_path / "file" / "bag")

"""Where a run records: an older bag is kept until the new one is whole."""

from __future__ import annotations

from pathlib import Path

import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.files import MARKER
from deeptruck_model.recordings import CrashSafeWriter
from deeptruck_nodes.bag_place import BAG, claimed, is_whole


def recorded(bag: Path, says: str = "old") -> None:
    """What the recorder does."""
    writer = CrashSafeWriter(bag, custom_data={"says": f'"{says}"'})
    with claimed(bag):
        writer.close()


def content(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_a_bag_of_ours_is_replaced_once_the_new_one_is_whole(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    recorded(bag)
    old = content(bag)
    with pytest.raises(InputError, match="--record, or add --overwrite"):
        BAG.check(bag)
    with BAG.recording(bag, overwrite=True, whole=is_whole):
        assert content(tmp_path / "bag.old") == old
        recorded(bag, "new")
    assert [p.name for p in tmp_path.iterdir()] == ["bag"] and content(bag) != old
    assert content(bag).keys() == {"bag_0.mcap", "metadata.yaml", MARKER}


def test_an_empty_folder_may_become_the_bag(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    with BAG.recording(bag, overwrite=False, whole=is_whole):
        recorded(bag)
    assert [p.name for p in tmp_path.iterdir()] == ["bag"] and is_whole(bag)

"""Facts about a bag from its metadata alone, before anything heavy is imported."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any, Literal

import yaml

from deeptruck_core.errors import InputError
from deeptruck_core.reading import parse_yaml, typed
from deeptruck_core.signals import TruckInterface
from deeptruck_model.manifest import MANIFEST

METADATA = "metadata.yaml"  # what a rosbag2 folder says of itself; without one the bag is not finished
EXTRA_KEY = "deeptruck.extra"  # names of the channels on /extra
INTERFACE_KEY, NOTES_KEY = "deeptruck.interface", "deeptruck.notes"  # stored with a bag, as JSON
Clock = Literal["log", "stamp"]  # of a message's two times: when it was recorded, and its header's
MAGIC = {".mcap": b"\x89MCAP0\r\n", ".db3": b"SQLite format 3\0", ".bag": b"#ROSBAG V"}
RECORD_AGAIN = (
    "record while the truck's topics are published ('ros2 topic list' shows them): with --record of a start "
    "script, or with 'ros2 bag record -a'"
)


@dataclass(frozen=True)
class BagFacts:
    """The truck interface stored in a bag, None without one, and the number of messages by topic, None if it
    cannot be known without reading the bag."""

    path: Path
    interface: TruckInterface | None = None
    messages: Mapping[str, int] | None = None


def bag(path: Path) -> BagFacts:
    """Facts about a bag from its metadata: a rosbag2 folder, or a single .mcap, .db3 or .bag file.

    Raises InputError if there is no finished bag.
    """
    if not path.exists():
        raise InputError(f"{path} does not exist")
    if path.is_file():
        _check_magic(path)
        return BagFacts(path)
    check_folder(path)
    if not (path / METADATA).is_file():
        return BagFacts(path)
    information = information_of(path / METADATA)
    try:
        messages = _messages(information)
        missing = [
            name for name in information["relative_file_paths"] if not data_file(path, str(name)).is_file()
        ]
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{path / METADATA} is damaged ({error!r}); {_MEND}") from None
    if missing:
        raise InputError(f"{path} has lost {', '.join(missing)}; restore it, or give another bag")
    if messages is not None and not any(messages.values()):
        raise InputError(f"{path} is empty, it holds no message; {RECORD_AGAIN}")
    return BagFacts(path, _interface(path, information), messages)


_MEND = "remove it and mend the bag with 'deeptruck-model repair'"


def _check_magic(path: Path) -> None:
    magic = MAGIC.get(path.suffix)
    try:
        begin = path.open("rb").read(len(magic or b""))
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None
    if magic is None or begin != magic:
        raise InputError(
            f"{path} cannot be read as a bag; a table or CAN log needs 'deeptruck-model import', "
            "a cut-off bag 'deeptruck-model repair'"
        )


def parts(folder: Path) -> list[Path]:
    """The MCAP files NAME_0, NAME_1 ... of one recording that was split, in a folder whose metadata.yaml is
    lost; empty for others."""
    found = sorted(folder.glob("*.mcap"))
    names = [re.fullmatch(r"(.+)_(\d+)", file.stem) for file in found]
    alike = {name[1] if name else None for name in names}
    return found if len(found) > 1 and len(alike) == 1 and None not in alike else []


def check_folder(path: Path) -> None:
    """Raises InputError for a folder that holds no finished bag."""
    if (path / METADATA).is_file():
        return
    if (path / MANIFEST).exists():
        raise InputError(f"{path} is a simulator directory, not a bag; give a recording there")
    if not any(path.iterdir()):
        raise InputError(f"{path} is empty, it holds no bag; {RECORD_AGAIN}")
    if parts(path):
        return
    if len(several := sorted(path.glob("*.mcap"))) > 1:
        raise InputError(f"{path} holds {len(several)} bags; give each by its file, as {typed(several[0])}")
    if several:
        raise InputError(
            f"{path} is not a finished bag (it has no {METADATA}); "
            f"if its recorder was killed, mend it with 'deeptruck-model repair {typed(path)}'"
        )
    if any(path.glob("*.db3")):  # a database is whole at any time
        return
    if inside := list(path.glob(f"*/{METADATA}")):
        raise InputError(f"{path} is no bag, but a folder of {len(inside)}; give these: {path / '*'}")
    raise InputError(
        f"{path} is no bag: it has no {METADATA} and no .mcap or .db3 file; give the folder of a bag"
    )


def data_file(folder: Path, name: str) -> Path:
    """A file of a bag by its name in metadata.yaml, which some recorders prefix with a folder."""
    return folder / name if (folder / name).is_file() else folder / PurePath(name).name


def information_of(file: Path) -> dict[str, Any]:
    """The content of metadata.yaml."""
    try:
        information = parse_yaml(file.read_text(encoding="utf-8"))["rosbag2_bagfile_information"]
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror}") from None
    except (yaml.YAMLError, ValueError, KeyError, TypeError, RecursionError) as error:
        says = " ".join(str(error).split())[:120]
        raise InputError(f"{file} is damaged ({says}); {_MEND}") from None
    if not isinstance(information, dict):
        raise InputError(f"{file} is damaged (it holds no table); {_MEND}")
    return information


def _messages(information: dict[str, Any]) -> dict[str, int] | None:
    """Messages by topic; None for compressed files, in which some recorders do not count them."""
    found: dict[str, int] = {}
    for entry in information["topics_with_message_count"]:
        name = str(entry["topic_metadata"]["name"])
        found[name] = found.get(name, 0) + int(entry["message_count"])
    return None if information.get("compression_mode") else found


def _interface(path: Path, information: dict[str, Any]) -> TruckInterface | None:
    custom = information.get("custom_data")
    if not isinstance(custom, dict) or INTERFACE_KEY not in custom:
        return None
    try:
        data = json.loads(custom[INTERFACE_KEY])
    except (ValueError, TypeError, RecursionError) as error:
        raise InputError(f"{path}: its {INTERFACE_KEY} is not JSON ({error})") from None
    return TruckInterface.from_dict(data) if isinstance(data, dict) else None

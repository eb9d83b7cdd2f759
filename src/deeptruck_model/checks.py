"""What can be said of simulators and bags before anything heavy is imported: manifests and metadata alone.

A command calls these first, so that a wrong path or units that do not fit cost a second, not a minute. Here
are the standard library and YAML only, and numpy where a physics truck has overrides.
"""

from __future__ import annotations

import difflib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from importlib import resources
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import yaml

from deeptruck_model import files, reading
from deeptruck_model.errors import InputError, MisfitsError
from deeptruck_model.outside import saved
from deeptruck_model.outside.reference import FMU_FORM, FORM, is_outside
from deeptruck_model.outside.truck import KIND, look
from deeptruck_model.signals import TruckInterface

MANIFEST = (
    "simulator.json"  # {"kind": "physics|deep|corrected", "schema": 1, "interface": {...}, "dt": 0.1, ...}
)
KINDS = "deeptruck.simulators"  # entry points: kinds of simulator directories, and who loads each
SCHEMES = "deeptruck.simulator_schemes"  # by what stands before a colon: a function of what stands behind it
METADATA = "metadata.yaml"  # what a rosbag2 folder says of itself; without one the bag is not finished
INTERFACE_KEY, NOTES_KEY = "deeptruck.interface", "deeptruck.notes"  # stored with a bag, as JSON
WEIGHTS = "model.safetensors"  # of a deep truck
TOPICS = {  # of the channels that a simulator cannot do without, as docs/architecture.md names them
    "speed": "/truck/twist",
    "engine_command": "/truck/command",
    "brake_command": "/truck/command",
    "grade": "/road",
}
MAGIC = {".mcap": b"\x89MCAP0\r\n", ".db3": b"SQLite format 3\0", ".bag": b"#ROSBAG V"}
RECORD_AGAIN = (
    "record while the truck's topics are published ('ros2 topic list' shows them): with --record of a start "
    "script, or with 'ros2 bag record -a'"
)


@dataclass(frozen=True)
class SimulatorFacts:
    """What a simulator says of itself: `kind` is an entry point of KINDS, `dt` its step in s."""

    name: str
    kind: str
    interface: TruckInterface
    dt: float


@dataclass(frozen=True)
class Mapped:
    """What a topic map says: the topic of each channel that it names, and the units it gives commands."""

    topics: Mapping[str, str]
    units: Mapping[str, str]


@dataclass(frozen=True)
class BagFacts:
    """What a bag says of itself.

    `interface` is None where none is stored; `messages` is their number by topic, None where only the bag's
    content tells. `mapped` is the topic map that it is read by, None for our own topics.
    """

    path: Path
    interface: TruckInterface | None
    messages: Mapping[str, int] | None
    mapped: Mapped | None = None

    def lacks(self, channel: str) -> bool:
        """Whether the channel is certainly not there; False where only the bag's content tells."""
        if self.mapped is not None and channel not in self.mapped.topics:
            return True
        topic = (self.mapped.topics if self.mapped else TOPICS).get(channel)
        return topic is not None and self.messages is not None and not self.messages.get(topic)

    def unit(self, channel: str) -> str | None:
        """The unit of a command; None where it is not told."""
        if self.mapped is not None and channel in self.mapped.units:
            return self.mapped.units[channel]
        if self.interface is None or (channel == "brake_command" and self.interface.brake_unit is None):
            return None
        return self.interface.unit(channel)


def every(*tries: Callable[[], object]) -> None:
    """Call all of them. Raises one InputError with every misfit that they found, each said once."""
    found: list[str] = []
    for attempt in tries:
        try:
            attempt()
        except MisfitsError as several:
            found += several.found
        except InputError as error:
            found.append(str(error))
    refuse(found)


def refuse(misfits: Iterable[str]) -> None:
    """Raises InputError where there are misfits: one as it is, several counted in one line."""
    found = list(dict.fromkeys(misfits))
    if len(found) == 1:
        raise InputError(found[0])
    if found:
        raise MisfitsError(found)


def mass(mass_kg: float | None) -> None:
    """Raises InputError for a mass (kg) that no vehicle can have."""
    if mass_kg is not None and not 0.0 < mass_kg < float("inf"):
        raise InputError(f"a mass of {mass_kg:g} kg cannot be; state what the truck weighs, in kg")


def inputs(simulator_text: str | None, bags: Sequence[Path], *, mapped: Mapped | None = None) -> None:
    """Whether the simulator and the bags, read by the topic map `mapped`, are there and fit one another.

    Raises one InputError with every misfit.
    """
    found: list[str] = []

    def tried(look: Callable[[], Any]) -> Any:
        try:
            return look()
        except InputError as error:
            found.append(str(error))

    facts = None if simulator_text is None else tried(lambda: simulator(simulator_text))
    known = [tried(partial(bag, path, mapped=mapped)) for path in dict.fromkeys(bags)]
    if facts is not None:
        found += [misfit for one in known if one is not None for misfit in misfits(facts, one)]
    refuse(found)


def misfits(facts: SimulatorFacts, one: BagFacts) -> list[str]:
    """Why a bag cannot be compared with a simulator, a line each: channels that lack, units that differ."""
    found = []
    lacking = [name for name in (*facts.interface.u, *facts.interface.w) if one.lacks(name)]
    if lacking:
        found.append(
            f"{one.path} has no {', '.join(lacking)}, which the simulator {facts.name} needs; "
            "record it or use another simulator"
        )
    for name in facts.interface.u:
        here, there = one.unit(name), facts.interface.unit(name)
        if name not in lacking and here not in (None, there):
            found.append(
                f"{one.path} has {name} in {here}, the simulator {facts.name} takes {there}; "
                "import it with the simulator's unit, or use another simulator"
            )
    return found


def same_truck(bags: Sequence[Path], *, mapped: Mapped | None = None) -> None:
    """Raises InputError where bags cannot be trained on together: their commands differ in unit, or none has
    an engine command."""
    found: list[str] = []
    commanded = False
    first: dict[str, tuple[str, Path]] = {}
    for path in bags:
        try:
            one = bag(path, mapped=mapped)
        except InputError as error:
            found.append(str(error))
            continue
        commanded = commanded or not one.lacks("engine_command")
        for name in ("engine_command", "brake_command"):
            unit = one.unit(name)
            known, where = first.setdefault(name, (unit, path)) if unit else (unit, path)
            if unit != known:
                found.append(f"{path} has {name} in {unit}, {where} in {known}; train on bags of one truck")
    if not commanded and not found:
        found.append("no bag has an engine_command; a truck cannot be learned without it")
    refuse(found)


def adapted(start: str, bags: Sequence[Path], *, mapped: Mapped | None = None) -> None:
    """Raises InputError where a training cannot start from the deep truck `start` on these bags."""
    facts = simulator(start)
    if facts.kind != "deep":
        raise InputError(f"{start} is no deep truck; only one of those can be adapted")
    found: list[str] = []
    for path in bags:
        with suppress(InputError):  # said by who looks at the bags themselves
            found += misfits(facts, bag(path, mapped=mapped))
    refuse(f"{misfit}, or train from scratch, without --from" for misfit in found)


def simulator(text: str) -> SimulatorFacts:
    """What simulators.load takes, by what it says of itself; an outside one is made for that.

    Raises InputError for a truck or override that is not there, a factory that makes no simulator, or a
    directory that is none.
    """
    if text.startswith("truck:"):
        _, name, *overrides = text.split(":", 2)
        return _physics_truck(text, name, overrides[0] if overrides else None)
    if is_outside(text):
        return SimulatorFacts(text, KIND, *look(text))
    if by_scheme(text):  # of another package, which alone knows what it is
        scheme, _, rest = text.partition(":")
        other = entry_points(group=SCHEMES)[scheme].load()(rest)
        return SimulatorFacts(text, scheme, other.interface, other.dt)
    path = Path(text)
    data = manifest(path)
    _check_beneath(path, data)
    if data["kind"] == "deep" and not (path / WEIGHTS).is_file():
        raise InputError(f"{path} has lost {WEIGHTS}; restore that file, or train again")
    try:
        return SimulatorFacts(
            text, data["kind"], TruckInterface.from_dict(data["interface"]), float(data.get("dt", 0.1))
        )
    except (KeyError, TypeError, ValueError) as error:
        says = str(error) if isinstance(error, InputError) else repr(error)
        raise InputError(
            f"{path / MANIFEST} is damaged ({says}); train or save the simulator again"
        ) from None


def _check_beneath(path: Path, data: dict[str, Any]) -> None:
    """Raises InputError where what a directory corrects is lost, or is an outside simulator that changed."""
    if data["kind"] == "corrected":
        _check_beneath(path / "base", manifest(path / "base"))
    elif data["kind"] == KIND:
        saved.check(path, data)


def by_scheme(text: str) -> bool:
    """Whether a simulator is named by what stands before a colon, and not by the path of a directory."""
    scheme, _, rest = text.partition(":")
    return bool(rest) and scheme in {entry.name for entry in entry_points(group=SCHEMES)}


def deep_simulator(text: str) -> SimulatorFacts:
    """A simulator directory of a deep truck. Raises InputError for any other."""
    facts = simulator(text)
    if facts.kind != "deep":
        raise InputError(f"{text} is no deep truck; train one with 'deeptruck-model train'")
    return facts


def manifest(path: Path) -> dict[str, Any]:
    """The manifest of a simulator directory. Raises InputError where it is missing, damaged or unknown."""
    if not path.exists():
        raise InputError(
            f"{path} does not exist; give a simulator directory, {_trucks()}, {FORM} or {FMU_FORM}"
        )
    if not (path / MANIFEST).exists():
        raise InputError(
            f"{path} is not a simulator directory: it has no {MANIFEST}; 'deeptruck-model train' makes one"
        )
    data = reading.json_object(path / MANIFEST, reading.SAVE_AGAIN)
    kinds = sorted(entry.name for entry in entry_points(group=KINDS))
    if data.get("kind") not in kinds:
        raise InputError(f"{path / MANIFEST} has no known kind; installed are {', '.join(kinds) or 'none'}")
    return data


def trucks() -> tuple[str, ...]:
    """Names of the reference trucks."""
    names = (entry.name for entry in _pool().iterdir())
    return tuple(sorted(name.removesuffix(".yaml") for name in names if name.endswith(".yaml")))


def _trucks() -> str:
    return ", ".join(f"truck:{name}" for name in trucks())


def _pool() -> Any:
    return resources.files("deeptruck_model") / "trucks" / "pool"


def _physics_truck(text: str, name: str, overrides: str | None) -> SimulatorFacts:
    if name not in trucks():
        near = difflib.get_close_matches(name, trucks(), n=1)
        hint = f"did you mean {near[0]}?" if near else f"known: {', '.join(trucks())}"
        raise InputError(f"there is no truck '{name}'; {hint}")
    if overrides is None:
        data = yaml.safe_load((_pool() / f"{name}.yaml").read_text())["interface"]
        return SimulatorFacts(text, "physics", TruckInterface.from_dict({"name": name, **data}), 0.1)
    if "=" in overrides and not Path(overrides).exists():
        raise InputError(
            f"'{overrides}' is no file: parameters are replaced by a YAML file that holds lines such as "
            f"'mass: 25000', given as truck:{name}:FILE.yaml"
        )
    from deeptruck_model.trucks.specification import from_pool, override, read_yaml

    truck = override(from_pool(name), read_yaml(Path(overrides)), overrides)
    return SimulatorFacts(text, "physics", truck.interface, 0.1)


def bag(path: Path, *, mapped: Mapped | None = None, any_topics: bool = False) -> BagFacts:
    """A bag by its metadata: a rosbag2 folder, or a lone .mcap, .db3 or .bag file.

    Raises InputError where there is no finished bag, or it holds no speed on our topics, or not all topics of
    the map `mapped`; with `any_topics` they may be others.
    """
    if not path.exists():
        beside = "".join(f"; {line}" for line in files.left_beside(path))
        raise InputError(f"{path} does not exist{beside}")
    files.tell_left_beside(path)
    if path.is_file():
        _check_magic(path)
        return BagFacts(path, None, None, mapped)
    _check_folder(path)
    information = _information(path / METADATA)
    try:
        messages = _messages(information)
        missing = [name for name in information["relative_file_paths"] if not (path / name).is_file()]
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{path / METADATA} is damaged ({error!r}); {_MEND}") from None
    one = BagFacts(path, _interface(path, information), messages, mapped)
    if missing:
        raise InputError(f"{path} has lost {', '.join(missing)}; restore it, or give another bag")
    if one.messages is not None and not any(one.messages.values()):
        raise InputError(f"{path} is empty, it holds no message; {RECORD_AGAIN}")
    if not any_topics:
        _check_topics(one)
    return one


def _check_topics(one: BagFacts) -> None:
    held = sorted(name for name, count in (one.messages or {}).items() if count)
    present = f"(topics there: {', '.join(held)})"
    for channel, topic in one.mapped.topics.items() if one.mapped and one.messages else ():
        if topic not in held:
            raise InputError(
                f"{one.path} has no message on {topic}, where the topic map has '{channel}' {present}; "
                "change that line, or leave it out"
            )
    if one.lacks("speed"):
        raise InputError(
            f"{one.path} has no speed: no message on {TOPICS['speed']} {present}; name yours in a topic map, "
            "--topic-map FILE: 'deeptruck-model suggest' proposes one"
        )


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


def _check_folder(path: Path) -> None:
    if (path / METADATA).is_file():
        return
    if (path / MANIFEST).exists():
        raise InputError(f"{path} is a simulator directory, not a bag; give a recording there")
    if not any(path.iterdir()):
        raise InputError(f"{path} is empty, it holds no bag; {RECORD_AGAIN}")
    if any(path.glob("*.mcap")):
        raise InputError(
            f"{path} is not a finished bag (it has no {METADATA}); "
            "if its recorder was killed, mend it with 'deeptruck-model repair'"
        )
    raise InputError(f"{path} is no bag: it has no {METADATA} and no .mcap file; give the folder of a bag")


def _information(file: Path) -> dict[str, Any]:
    """What metadata.yaml says, by the fastest parser there is: a bag of many files has a long one."""
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        data = yaml.load(file.read_text(encoding="utf-8"), Loader=loader)
        information = data["rosbag2_bagfile_information"]
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror}") from None
    except (yaml.YAMLError, ValueError, KeyError, TypeError, RecursionError) as error:
        says = " ".join(str(error).split())[:120]
        raise InputError(f"{file} is damaged ({says}); {_MEND}") from None
    if not isinstance(information, dict):
        raise InputError(f"{file} is damaged (it holds no table); {_MEND}")
    return information


def _messages(information: dict[str, Any]) -> dict[str, int] | None:
    """Messages by topic; None in compressed files, of which some recorders count none."""
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

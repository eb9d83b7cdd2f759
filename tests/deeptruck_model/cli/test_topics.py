"""From a bag with topics of the user's own to a simulator: suggest, then --topic-map or import."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from deeptruck_model.recordings import Recording, read

Script = Callable[..., tuple[int, str, str]]
TYPES = get_typestore(Stores.ROS2_JAZZY)
S = 1_000_000_000
TAKES_A_MAP = (
    "train bag --out out",
    "coverage bag --out out",
    "evaluate truck:trucksim bag --out out",
    "calibrate sim bag --out out",
    "mismatch --simulator truck:trucksim --recordings bag --out out",
)


def number(value: float) -> Any:
    return TYPES.types["std_msgs/msg/Float64"](value)


@pytest.fixture
def foreign(bag: Callable[..., Path]) -> Callable[..., Path]:
    """foreign(path, seconds, storage) -> a drive of `trucksim` on topics of somebody else."""

    def _foreign(path: Path, seconds: float, storage: StoragePlugin = StoragePlugin.MCAP) -> Path:
        (drive,) = read(bag(path.name, seconds))
        kind = "std_msgs/msg/Float64"
        named = {
            "/can/speed_kmh": 3.6 * drive.channels["speed"],
            "/can/torque_request_nm": drive.channels["engine_command"],
            "/can/brake_percent": drive.channels["brake_command"],
            "/map/slope_percent": 100.0 * drive.channels["grade"],
            "/can/fuel_lph": 3.6 * drive.channels["fuel_rate"],
        }
        with Writer(path, version=9, storage_plugin=storage) as writer:
            for topic, values in named.items():
                connection = writer.add_connection(topic, kind, typestore=TYPES)
                for k, value in enumerate(values):
                    content = TYPES.serialize_cdr(number(float(value)), kind)
                    writer.write(connection, S + k * S // 10, content)
        return path

    return _foreign


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_suggest_then_import(
    here: Path, script: Script, foreign: Callable[..., Path], storage: StoragePlugin
) -> None:
    """The converted bag holds what reading by the map gives, and needs no map."""
    source = foreign(here / "mine", 60.0, storage)
    code, said, errors = script("suggest", source, "--out", "topics.yaml")
    assert (code, errors) == (0, "") and "/can/speed_kmh" in said
    assert yaml.safe_load((here / "topics.yaml").read_text())["speed"]["unit"] == "km/h"
    assert script("import", source, "--columns", "topics.yaml", "--out", "drive")[0] == 0
    (ours,), (mapped,) = read("drive"), read(source, topic_map="topics.yaml")
    assert same(ours, mapped) and ours.interface == mapped.interface
    assert ours.interface.engine_unit == "N m" and "grade" in ours.channels


def same(one: Recording, other: Recording) -> bool:
    pairs = [(one.channels[name], other.channels[name]) for name in other.channels]
    return set(one.channels) == set(other.channels) and all(
        np.array_equal(a, b, equal_nan=True) for a, b in pairs
    )


@pytest.mark.usefixtures("undrawn")
def test_train_and_evaluate_by_a_map(here: Path, script: Script, foreign: Callable[..., Path]) -> None:
    """Two bags of one name: their drives stay apart."""
    bags = [foreign(here / "a" / "drive", 150.0), foreign(here / "b" / "drive", 170.0)]
    assert script("suggest", bags[0], "--out", "topics.yaml")[0] == 0
    words = ("--topic-map", "topics.yaml")
    code, _, errors = script("train", *bags, "--out", "sim", "--budget", "2", *words)
    assert code == 0, errors
    card = Path("sim/MODEL_CARD.md").read_text()
    assert "a/drive" in card and "b/drive" in card
    code, _, errors = script("evaluate", "sim", bags[1], "--out", "open_loop", "--trials", "2", *words)
    assert code == 0, errors
    code, _, errors = script("evaluate", "truck:volvo", bags[1], "--out", "other", *words)
    assert code == 2 and "the simulator takes" in errors


def test_what_lacks_is_said(here: Path, script: Script) -> None:
    with Writer(here / "mine", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/speed", "std_msgs/msg/Float64", typestore=TYPES)
        for k in range(30):
            writer.write(connection, S + k * S // 10, TYPES.serialize_cdr(number(k), "std_msgs/msg/Float64"))
    code, _, errors = script("suggest", "mine", "--out", "topics.yaml")
    assert code == 0 and "brake_command" in errors
    code, _, errors = script("train", "mine", "--topic-map", "topics.yaml", "--out", "sim")
    assert code == 2 and "no recording has an engine_command" in errors and not Path("sim").exists()


@pytest.mark.parametrize("line", TAKES_A_MAP)
@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "topics.yaml cannot be read: it does not exist"),
        ("- speed\n", "topics.yaml must hold 'key: value' pairs"),
        (
            "speed: {topic: /v}\n",
            "topic map: speed: 'field' is missing; it needs topic and field",
        ),
        ("grade: {topic: /g, field: data}\n", "topics.yaml: topic map: 'speed' is missing"),
    ],
)
def test_a_map_that_is_none_is_one_line(
    here: Path, script: Script, line: str, content: str | None, says: str
) -> None:
    if content is not None:
        (here / "topics.yaml").write_text(content)
    code, _, errors = script(*line.split(), "--topic-map", "topics.yaml")
    assert code == 2 and says in errors and errors.count("\n") == 1
    assert {path.name for path in here.iterdir()} <= {"topics.yaml"}


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("suggest", "none"), "none does not exist"),
        (("suggest", "drive.log"), "is read as a CAN log"),
        (("suggest", "table.csv", "--out", "other.yaml"), "other.yaml"),
        (("suggest", "words.csv"), "words.csv is no table"),
        (("import", "mine", "--columns", "none.yaml", "--out", "out"), "none.yaml cannot be read"),
        (
            ("import", "mine", "--columns", "other.yaml", "--out", "out"),
            "no topic /v for 'speed'",
        ),
        (
            ("import", "mine", "--columns", "other.yaml", "--out", "mine/out"),
            "or inside it, which is read here",
        ),
    ],
)
def test_bad_input_of_suggest_and_import(
    here: Path, script: Script, foreign: Callable[..., Path], words: tuple[str, ...], says: str
) -> None:
    foreign(here / "mine", 10.0)
    (here / "table.csv").write_text("a,b\n1,2\n")
    (here / "drive.log").write_text("")
    (here / "words.csv").write_text("It was a dark night.\n")
    (here / "other.yaml").write_text("speed: {topic: /v, field: data}\n")
    code, _, errors = script(*words)
    assert code == 2 and says in errors and errors.count("\n") == 1 and not Path("out").exists()


def test_suggest_then_import_a_table(here: Path, script: Script) -> None:
    rows = "".join(f"{k / 10:.1f};{20 + 0.1 * k:.1f};{k % 50};7\n".replace(".", ",") for k in range(300))
    header = "Zeit [s];Geschwindigkeit [km/h];Gaspedal [%];Sollgeschwindigkeit [km/h]\n"
    (here / "drive.csv").write_text(header + rows)
    code, said, errors = script("suggest", "drive.csv", "--out", "columns.yaml")
    assert code == 0 and "brake_command" in errors
    assert script("suggest", "drive.csv")[1] == (here / "columns.yaml").read_text()
    assert script("suggest", "drive.csv", "--out", "columns.yaml")[0] == 2
    code, said, _ = script("import", "drive.csv", "--columns", "columns.yaml", "--out", "drive")
    assert code == 0 and "300 used" in said
    (recording,) = read(here / "drive")
    assert recording.channels["speed"][0] == pytest.approx(20.0 / 3.6)

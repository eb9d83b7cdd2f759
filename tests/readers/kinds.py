"""Every kind of file that a user may give: how a small valid one is made, and how it is read."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import can
import numpy as np
import pyarrow as pa
from damage import Reader
from mcap.writer import CompressionType, Writer
from pyarrow import parquet
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from deeptruck_cacc.controllers.loading import load_policy
from deeptruck_cacc.controllers.policy import MlpPolicy
from deeptruck_cacc.controllers.scaling import ActionScale, FeatureMap
from deeptruck_model import simulators, trucks
from deeptruck_model.recordings import Recording, import_table, read, suggest, write_bag
from deeptruck_model.recordings.bag_metadata import definition
from deeptruck_model.recordings.columns import load_columns
from deeptruck_model.recordings.topic_map import load as load_topic_map
from deeptruck_model.signals import TruckInterface
from truck_bridge import can_logs, j1939, vehicles
from truck_bridge.can_logs.rosbag import RosbagWriter

S = 1_000_000_000
TRUCK = TruckInterface("toy")
TWIST = "geometry_msgs/msg/TwistStamped"


def drive(samples: int = 40) -> Recording:
    """Four seconds with all that a deep truck is trained on."""
    names = ("acceleration", "speed", "fuel_rate", "engine_command", "brake_command", "grade")
    channels = {name: 0.05 * k + 0.001 * np.arange(samples) for k, name in enumerate(names)}
    return Recording("drive", 0.1, channels, TRUCK)


# Bags


def read_bag(file: Path) -> list[Any]:
    """The recordings of a lone file, or of the folder around it."""
    bag = file.parent if (file.parent / "metadata.yaml").exists() else file
    return [
        (r.name, r.dt, r.start_s, r.interface.to_dict(), r.channels)
        for r in read(bag, interface=None if bag == file.parent else TRUCK)
    ]


def propose_map(file: Path) -> list[Any]:
    """What a bag of unknown topics is taken for."""
    found = suggest(file.parent if (file.parent / "metadata.yaml").exists() else file)
    return [found.survey.topics, found.text().partition("\n")[2]]


def our_bag(folder: Path) -> Path:
    """As `import` writes it: MCAP with checksums and our own metadata."""
    return next(write_bag(folder / "bag", [drive()], interface=TRUCK).glob("*.mcap"))


def lone(make: Callable[[Path], Path]) -> Callable[[Path], Path]:
    """The bag's file alone."""

    def made(folder: Path) -> Path:
        file = make(folder)
        return Path(shutil.copy(file, folder / f"lone{file.suffix}"))

    return made


def metadata_of(make: Callable[[Path], Path]) -> Callable[[Path], Path]:
    """The metadata.yaml beside the bag's file."""
    return lambda folder: make(folder).parent / "metadata.yaml"


def _twists(samples: int = 40) -> Iterator[tuple[int, Any]]:
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    for k in range(samples):
        ns = S + k * S // 10
        stamp = types["builtin_interfaces/msg/Time"](ns // S, ns % S)
        header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="map")
        moving = types["geometry_msgs/msg/Vector3"](10 + 0.1 * k, 0.0, 0.0)
        yield ns, types[TWIST](header, types["geometry_msgs/msg/Twist"](moving, zero))


def mcap(compression: CompressionType, *, chunked: bool = True) -> Callable[[Path], Path]:
    """A lone file by the format's own library, in several chunks."""

    def made(folder: Path) -> Path:
        store = get_typestore(Stores.ROS2_JAZZY)
        file = folder / "drive.mcap"
        with file.open("wb") as stream:
            writer = Writer(stream, chunk_size=1024, compression=compression, use_chunking=chunked)
            writer.start(profile="ros2", library="test")
            schema = writer.register_schema(TWIST, "ros2msg", definition(TWIST)[0].encode())
            channel = writer.register_channel("/truck/twist", "cdr", schema)
            for k, (ns, message) in enumerate(_twists()):
                writer.add_message(channel, ns, bytes(store.serialize_cdr(message, TWIST)), ns, k)
            writer.finish()
        return file

    return made


def rosbag2(storage: StoragePlugin, mode: CompressionMode | None = None) -> Callable[[Path], Path]:
    """A folder by rosbags, which writes no checksums."""

    def made(folder: Path) -> Path:
        store = get_typestore(Stores.ROS2_JAZZY)
        writer = Writer2(folder / "bag", version=9, storage_plugin=storage)
        if mode is not None:
            writer.set_compression(mode, CompressionFormat.ZSTD)
        with writer:
            connection = writer.add_connection("/truck/twist", TWIST, typestore=store)
            for ns, message in _twists():
                writer.write(connection, ns, store.serialize_cdr(message, TWIST))
        return next(f for f in (folder / "bag").iterdir() if f.name != "metadata.yaml")

    return made


def rosbag1(folder: Path) -> Path:
    """A ROS 1 bag."""
    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    with Writer1(folder / "drive.bag") as writer:
        connection = writer.add_connection("/truck/twist", TWIST, typestore=store)
        zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
        for k in range(40):
            ns = S + k * S // 10
            stamp = types["builtin_interfaces/msg/Time"](ns // S, ns % S)
            header = types["std_msgs/msg/Header"](seq=k, stamp=stamp, frame_id="map")
            moving = types["geometry_msgs/msg/Vector3"](10 + 0.1 * k, 0.0, 0.0)
            message = types[TWIST](header, types["geometry_msgs/msg/Twist"](moving, zero))
            writer.write(connection, ns, store.serialize_ros1(message, TWIST))
    return folder / "drive.bag"


# Tables

COLUMNS = {
    "time": {"column": "t", "unit": "s"},
    "channels": {"speed": {"column": "v", "unit": "km/h"}, "elevation": {"column": "h", "unit": "m"}},
}


def _columns(rows: int = 40) -> dict[str, Any]:
    k = np.arange(rows)
    return {"t": np.round(5 + 0.1 * k, 3), "v": 36 + 0.25 * k, "h": 100 + 0.125 * k}


def csv_table(folder: Path) -> Path:
    """A CSV file."""
    rows = [
        ",".join(_columns()),
        *(",".join(map(str, row)) for row in zip(*_columns().values(), strict=True)),
    ]
    (folder / "table.csv").write_text("\n".join(rows) + "\n")
    return folder / "table.csv"


def parquet_table(folder: Path) -> Path:
    """A Parquet file with the checksums that the format has."""
    parquet.write_table(pa.table(_columns()), folder / "table.parquet", write_page_checksum=True)
    return folder / "table.parquet"


def read_table(file: Path) -> list[Any]:
    """What an import makes of a table."""
    out = file.parent / "imported"
    try:
        return [(r.dt, r.channels) for r in import_table(file, COLUMNS, out).recordings]
    finally:
        shutil.rmtree(out, ignore_errors=True)


def columns_yaml(folder: Path) -> Path:
    """COLUMNS.yaml with all its keys."""
    text = """# of truck 7
time: {column: t, unit: s}
delimiter: ";"
encoding: utf-8
skip_rows: 2
decimal: ","
name: truck7
grade_window_m: 60.0
split_at: {speed_step: 2.5, elevation_step: 4.0}
conceal: [grade]
channels:
  speed: {column: v, unit: km/h, scale: 1.0, offset: 0.0, late_s: 0.1}
  elevation: {column: h, unit: m}
  fuel_rate: {column: f, unit: kg/h, density: 0.83}
  grade: {column: g, unit: "%"}
"""
    (folder / "columns.yaml").write_text(text)
    return folder / "columns.yaml"


def topic_map(folder: Path) -> Path:
    """A topic map."""
    text = """speed: {topic: /odom, field: twist.twist.linear.x, unit: m/s}
grade: {topic: /road, field: "position[name=grade]", scale: 0.01, offset: 0.0}
fuel_rate: {topic: /fuel, field: data, unit: kg/h, density: 830}
"""
    (folder / "topics.yaml").write_text(text)
    return folder / "topics.yaml"


# CAN logs


def _frames() -> Iterator[can.Message]:
    for k in range(30):
        for can_id, data in (
            (0x0CF00400, bytes([0xF1, 125 + k, 125 + k, 0x40, 0x1F, 0, 0xFF, 0xFF])),
            (0x18FEF100, bytes([0xFF, k, 40, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF])),
        ):
            yield can.Message(timestamp=1.6e9 + 0.1 * k, arbitration_id=can_id, data=data, channel="can0")


def can_log(suffix: str) -> Callable[[Path], Path]:
    """A log by python-can."""

    def made(folder: Path) -> Path:
        with can.Logger(str(folder / f"log.{suffix}")) as log:
            for message in _frames():
                log.on_message_received(message)
        return folder / f"log.{suffix}"

    return made


def candump_console(folder: Path) -> Path:
    """As candump prints it."""
    lines = (
        f" ({m.timestamp:.6f})  can0  {m.arbitration_id:08X}   [8]  {bytes(m.data).hex(' ').upper()}\n"
        for m in _frames()
    )
    (folder / "console.log").write_text("".join(lines))
    return folder / "console.log"


def can_rosbag(folder: Path) -> Path:
    """Raw frames in a rosbag."""
    writer = RosbagWriter(folder / "log.mcap")
    for message in _frames():
        writer.on_message_received(message)
    writer.stop()
    return folder / "log.mcap"


def read_can(file: Path) -> Any:
    """The frames, and what an import makes of them."""
    return list(map(tuple, can_logs.read(file))), can_logs.import_can_log(file, {})


def read_blf(file: Path) -> Any:
    """As read_can, but of times only the differences: those of the file's head have no checksum."""
    frames = list(can_logs.read(file))
    return [(round(f.time - frames[0].time, 3), f.can_id, f.data) for f in frames]


def vehicle_yaml(folder: Path) -> Path:
    """A vehicle file of the package."""
    return Path(shutil.copy(Path(vehicles.__file__).parent / "trucksim.yaml", folder / "mine.yaml"))


def read_vehicle(file: Path) -> Any:
    """All of a vehicle but its DBC."""
    vehicle = vehicles.load(file)
    return vehicle.table, vehicle.interface, vehicle.reference_torque, vehicle.transmitted


def dbc(folder: Path) -> Path:
    """A vehicle's own DBC file."""
    text = vehicle_yaml(folder).read_text()
    (folder / "mine.yaml").write_text(text + "\ndbc: [own.dbc]\n")
    (folder / "own.dbc").write_text(
        'VERSION ""\nNS_ :\nBS_:\nBU_: ECU\nBO_ 2566834943 Own: 8 ECU\n'
        ' SG_ Level : 0|8@1+ (0.4,0) [0|100] "%" ECU\n'
        ' SG_ Heat : 8|16@1+ (0.03125,-273) [-273|1735] "degC" ECU\n'
        'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'
        'BA_DEF_DEF_ "VFrameFormat" "J1939PG";\nBA_ "VFrameFormat" BO_ 2566834943 3;\n'
    )
    return folder / "own.dbc"


def read_dbc(file: Path) -> Any:
    """The vehicle beside it."""
    j1939.load.cache_clear()
    return repr(vehicles.load(file.with_name("mine.yaml")).codec["Own"])


# Simulators and policies


@cache
def _deep() -> Any:
    """An untrained deep truck with all that is kept beside the weights."""
    from deeptruck_model.deep.data import coverage, driven
    from deeptruck_model.deep.data.scales import Scales
    from deeptruck_model.deep.network import Shape, TruckNetwork
    from deeptruck_model.deep.truck import DeepTruck

    shape = Shape(2, 1, 3, hidden=4, decoder=3)
    scales = Scales(np.zeros(6, np.float32), np.ones(6, np.float32))
    recordings = (drive(),)
    return DeepTruck(
        TruckNetwork(shape, scales, 0.1), TRUCK, coverage.measure(recordings), {"seeds": [0]}, recordings,
        driven.measure(recordings),
    )  # fmt: skip


def deep(name: str) -> Callable[[Path], Path]:
    """One of the files of a deep truck."""

    def made(folder: Path) -> Path:
        _deep().save(folder / "sim")
        return folder / "sim" / name

    return made


def physics(folder: Path) -> Path:
    """The manifest of a physics truck."""
    trucks.load("trucksim").save(folder / "sim")
    return folder / "sim" / simulators.MANIFEST


def corrected(folder: Path) -> Path:
    """The manifest of a corrected truck."""
    from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
    from deeptruck_model.mismatch.mechanisms.brakes import Heating
    from deeptruck_model.mismatch.mechanisms.commands import Delays
    from deeptruck_model.mismatch.mechanisms.variants import Static
    from deeptruck_model.mismatch.residual.components import Shares

    terms = [
        Term("dragging_brake", Static(), (0.05,)),
        Term("brake_fade", Static(Heating(120.0, "from", 0.0)), (0.1,)),
        Term("command_delay", Static(Delays((("all", 0.2),))), (1.0,)),
    ]
    shares = Shares([0.0, 30.0], [1e-3, 1e-3], [0.02, 0.02], [20.0, 8.0], 2e-4, 0.06, 2e4)
    truck = CorrectedTruck(
        trucks.load("trucksim"), terms, {"mass": 0.1}, shares, True, [7.0, 28.0], {"engine": 1.1}
    )
    truck.save(folder / "sim")
    return folder / "sim" / simulators.MANIFEST


def read_simulator(file: Path) -> Any:
    """A simulator, driven for a moment; what a deep truck knows beside its weights."""
    truck = simulators.load(file.parent)
    u, w, y0 = np.zeros((1, 4, 2)), np.zeros((1, 4, 1)), np.full((1, 3), 10.0)
    u[:, :, 0] = 500.0
    names = truck.interface.u, truck.interface.w, truck.interface.y
    if tuple(map(len, names)) != (2, 1, 3):
        return names
    seen = getattr(truck, "coverage", None)
    kept = [r.channels for r in getattr(truck, "reference", ())]
    return simulators.free_run(truck, u, w, y0).y, seen and seen.to_dict(), kept


def override_yaml(folder: Path) -> Path:
    """What is put after truck:trucksim: ."""
    (folder / "mine.yaml").write_text(
        "mass: 25000\nengine:\n  full_load_gain: 1.1\n"
        "  full_load: {speed: [50, 100, 200, 240], torque: [900, 2000, 1800, 0]}\n"
        "transmission: {ratios: [12.0, 6.0, 3.0, 1.5, 1.0]}\ninterface: {grade: true, fuel: true}\n"
    )
    return folder / "mine.yaml"


def read_override(file: Path) -> Any:
    """The truck, as data."""
    return json.loads(json.dumps(simulators.load(f"truck:trucksim:{file}").specification.to_dict()))


def policy(name: str) -> Callable[[Path], Path]:
    """One of the files of a policy."""

    def made(folder: Path) -> Path:
        rng = np.random.default_rng(0)
        features = FeatureMap.default(power=True)
        sizes = [len(features.names), 5, 2]
        layers = [(rng.normal(0, 0.4, (b, a)), rng.normal(0, 0.1, b)) for a, b in pairwise(sizes)]
        mlp = MlpPolicy(layers, features, ActionScale.of(TRUCK), TRUCK, {"speed": (7.0, 24.0)}, {"seed": 0})
        mlp.save(folder / "policy")
        return folder / "policy" / name

    return made


def read_policy(file: Path) -> Any:
    """What it commands."""
    seen = {"leader_speed": 20.0, "speed": 19.0, "gap": 40.0, "target_time_gap": 2.0, "grade": 0.01}
    found: Any = load_policy(file.parent)
    return [found.act(seen), found.act(seen), found.coverage, found.card]


MCAP, SQLITE = StoragePlugin.MCAP, StoragePlugin.SQLITE3
READERS = [
    Reader("bag of ours", our_bag, read_bag, checked=True),
    Reader("bag of ours, lone", lone(our_bag), read_bag, checked=True),
    Reader("metadata.yaml", metadata_of(our_bag), read_bag),
    Reader("mcap", mcap(CompressionType.NONE), read_bag, checked=True),
    Reader("mcap zstd", mcap(CompressionType.ZSTD), read_bag, checked=True),
    Reader("mcap lz4", mcap(CompressionType.LZ4), read_bag, checked=True),
    Reader("mcap without chunks", mcap(CompressionType.NONE, chunked=False), read_bag),
    Reader("rosbags mcap", rosbag2(MCAP), read_bag),
    Reader("rosbags mcap zstd", rosbag2(MCAP, CompressionMode.STORAGE), read_bag),
    Reader("rosbags mcap by message", rosbag2(MCAP, CompressionMode.MESSAGE), read_bag),
    Reader("rosbags mcap by file", rosbag2(MCAP, CompressionMode.FILE), read_bag),
    Reader("rosbags sqlite", rosbag2(SQLITE), read_bag),
    Reader("rosbags sqlite, lone", lone(rosbag2(SQLITE)), read_bag),
    Reader("rosbags sqlite metadata.yaml", metadata_of(rosbag2(SQLITE)), read_bag),
    Reader("ros 1 bag", rosbag1, read_bag),
    Reader("unknown mcap", mcap(CompressionType.NONE), propose_map, checked=True),
    Reader("unknown sqlite", rosbag2(SQLITE), propose_map),
    Reader("csv", csv_table, read_table),
    Reader("parquet", parquet_table, read_table),
    Reader("columns", columns_yaml, load_columns),
    Reader("topic map", topic_map, load_topic_map),
    Reader("candump log", can_log("log"), read_can),
    Reader("candump console", candump_console, read_can),
    Reader("asc", can_log("asc"), read_can),
    Reader("blf", can_log("blf"), read_blf, checked=True),
    Reader("trc", can_log("trc"), read_can),
    Reader("can rosbag", can_rosbag, read_can, checked=True),
    Reader("vehicle", vehicle_yaml, read_vehicle),
    Reader("dbc", dbc, read_dbc),
    Reader("physics manifest", physics, read_simulator),
    Reader("deep manifest", deep("simulator.json"), read_simulator),
    Reader("deep weights", deep("model.safetensors"), read_simulator, checked=True),
    Reader("deep coverage", deep("coverage.json"), read_simulator, checked=True),
    Reader("deep driven", deep("driven.safetensors"), read_simulator, checked=True),
    Reader("deep reference", deep("reference.safetensors"), read_simulator, checked=True),
    Reader("corrected manifest", corrected, read_simulator),
    Reader("truck overrides", override_yaml, read_override),
    Reader("policy manifest", policy("policy.json"), read_policy),
    Reader("policy weights", policy("policy.safetensors"), read_policy, checked=True),
]

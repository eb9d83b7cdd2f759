"""Every kind of file that a user may give: by what a small valid one is made, and by what it is read."""

from __future__ import annotations

from bag_files import lone, mcap, metadata_of, our_bag, propose_map, read_bag, rosbag1, rosbag2
from can_files import (
    can_log,
    can_rosbag,
    candump_console,
    dbc,
    read_blf,
    read_can,
    read_dbc,
    read_vehicle,
    vehicle_yaml,
)
from damage import Reader
from mcap.writer import CompressionType
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from simulator_files import (
    corrected,
    deep,
    override_yaml,
    physics,
    policy,
    read_override,
    read_policy,
    read_simulator,
)
from table_files import columns_yaml, csv_table, parquet_table, read_table, topic_map

from deeptruck_model.recordings.tables.columns import load_columns
from deeptruck_model.recordings.topic_map import load as load_topic_map

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

"""Tests mirror the source: each file has a test of its name, is imported by a test, or is listed with the
test that runs it through something else."""

from __future__ import annotations

import ast
import re
from pathlib import Path

TESTS = Path(__file__).parent
SOURCES = (TESTS.parent / "src", TESTS.parent / "exam" / "src")
# Files without a test of their name: their room, they, and the test that runs them.
THROUGH = """
deeptruck_cacc.environments: registration | deeptruck_cacc/environments/test_environment.py
deeptruck_cacc.evaluation: page | deeptruck_cacc/evaluation/test_evaluation.py
deeptruck_exam.cases: deep_trucks gates truth | deeptruck_exam/cases/test_cases.py
deeptruck_exam.laws: air brakes commands driveline engine load | deeptruck_exam/laws/test_catalogue.py
deeptruck_exam.laws: road sensors series tyres unknown | deeptruck_exam/laws/test_catalogue.py
deeptruck_exam.plants: simulators | deeptruck_exam/plants/test_plants.py
deeptruck_exam.worlds: drive drivers | deeptruck_exam/worlds/test_worlds.py
deeptruck_core.imports: lazy | deeptruck_model/checks/test_calls.py
deeptruck_core.imports: entry_points | deeptruck_model/test_checks.py
deeptruck_core: arrays formats frame_rows reading | readers/test_readers.py
deeptruck_core: schema | test_schemas.py
deeptruck_model.checks: bags compatibility simulators | deeptruck_model/test_checks.py
deeptruck_model.cli: inputs | deeptruck_model/cli/test_topics.py
deeptruck_model.cli: fleet | deeptruck_model/fleet/test_run.py
deeptruck_model.cli: mismatch | deeptruck_model/mismatch/test_cli.py
deeptruck_model.fleet: page | deeptruck_model/fleet/test_run.py
deeptruck_model.deep: card preparation | deeptruck_model/deep/test_training.py
deeptruck_model.deep.kernels: inference layers | deeptruck_model/deep/test_truck.py
deeptruck_model.mismatch.verdict: sizes | deeptruck_model/mismatch/verdict/test_findings.py
deeptruck_model.mismatch.residual.expression: memory | deeptruck_model/mismatch/residual/test_expression.py
deeptruck_model.mismatch.mechanisms: brakes commands | deeptruck_model/mismatch/mechanisms/test_mechanisms.py
deeptruck_model.mismatch.mechanisms: driveline engine | deeptruck_model/mismatch/mechanisms/test_mechanisms.py
deeptruck_model.mismatch.mechanisms: engine_drag load | deeptruck_model/mismatch/mechanisms/test_mechanisms.py
deeptruck_model.mismatch.mechanisms: air_tyres_road | deeptruck_model/mismatch/mechanisms/test_mechanisms.py
deeptruck_core.pages: document style | deeptruck_cacc/evaluation/test_evaluation.py
deeptruck_model.recordings: bag_file bag_storage | deeptruck_model/recordings/test_bad_bags.py
deeptruck_model.recordings: mcap_chunks message_definitions | deeptruck_model/recordings/test_bad_bags.py
deeptruck_model.recordings: interpolate | deeptruck_model/recordings/test_resample.py
deeptruck_model.recordings: schemas | test_schemas.py
deeptruck_model.recordings.consistency: proposals | deeptruck_model/recordings/tables/test_table_suggestion.py
deeptruck_model.recordings.consistency: windows | deeptruck_model/recordings/consistency/test_sensors.py
deeptruck_model.recordings.tables: samples | deeptruck_model/recordings/test_importing.py
deeptruck_model.recordings.tables: column table | deeptruck_model/recordings/tables/test_table_file.py
deeptruck_model.recordings.tables: mat_file | deeptruck_model/recordings/tables/test_meaning_by_data.py
deeptruck_model.recordings.tables: column_meanings | deeptruck_model/recordings/tables/test_meaning_by_data.py
deeptruck_model.recordings.tables: row_clock | deeptruck_model/recordings/tables/test_table_suggestion.py
deeptruck_model.simulators: protocol | deeptruck_model/simulators/test_protocol_check.py
deeptruck_model.trucks: brakes engine forces gearbox | deeptruck_model/trucks/test_reference.py
deeptruck_model.trucks: kernel parameters road start | deeptruck_model/trucks/test_reference.py
truck_bridge: fault_watch | truck_bridge/test_active_faults.py
truck_bridge: channels units | truck_bridge/test_vehicles.py
truck_bridge.can_logs: candump frames lines | truck_bridge/can_logs/test_formats.py
truck_bridge.can_logs: decoding faults | truck_bridge/can_logs/test_importing.py
truck_bridge.can_logs: pieces | truck_bridge/can_logs/test_reader.py
truck_bridge.emulator: messages sender | truck_bridge/emulator/test_ecus.py
truck_bridge.j1939: ids | truck_bridge/j1939/test_codec.py
truck_bridge.safety: core | safety/test_frames.py
truck_bridge.vehicles: loading schema vehicle | truck_bridge/test_vehicles.py
"""


def imported(path: Path) -> set[str]:
    """Names of modules, and of what is taken out of modules, that a file imports."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{a.name}" for a in node.names)}
        elif isinstance(node, ast.Import):
            found |= {a.name for a in node.names}
    return found


def test_every_source_file_has_a_test_or_is_run_by_one_that_is_listed() -> None:
    own = set().union(*(imported(p) for p in TESTS.rglob("*.py")))
    alone = set()
    for source in SOURCES:
        for path in source.rglob("*.py"):
            place = path.relative_to(source).with_suffix("")
            module = ".".join(place.parts)
            mirrored = TESTS / place.parent / f"test_{place.name.strip('_')}.py"
            if path.name[:2] != "__" and module not in own and not mirrored.exists():
                alone.add(module)
    rows = [re.split(": | [|] ", line) for line in THROUGH.strip().splitlines()]
    listed = {f"{room}.{name}" for room, names, _ in rows for name in names.split()}
    missing = sorted(alone - listed)
    assert not missing, f"write a test of their name, or list the test that runs them: {missing}"
    files = {m: f"{m.replace('.', '/')}.py" for m in listed}
    assert not [m for m in listed if not any((source / files[m]).exists() for source in SOURCES)]
    assert not [test for _, _, test in rows if not (TESTS / test).exists()]

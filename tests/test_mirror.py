"""Tests mirror the source: each file has a test of its name, is imported by a test, or is listed with the
test that runs it through something else."""

from __future__ import annotations

import ast
from pathlib import Path

TESTS = Path(__file__).parent
SOURCE = TESTS.parent / "src"
THROUGH = {  # files without a test of their name, by room and by the test that runs them
    "deeptruck_cacc.controllers": {
        "deeptruck_cacc/controllers/test_planner.py": "signed_pedal",
    },
    "deeptruck_cacc.evaluation": {
        "deeptruck_cacc/evaluation/test_evaluation.py": "overview page",
    },
    "deeptruck_exam.cases": {
        "deeptruck_exam/cases/test_cases.py": "deep_trucks gates truth",
    },
    "deeptruck_exam.laws": {
        "deeptruck_exam/laws/test_catalogue.py": (
            "air brakes commands driveline engine load road sensors series tyres unknown"
        ),
    },
    "deeptruck_exam.plants": {
        "deeptruck_exam/plants/test_plants.py": "simulators",
    },
    "deeptruck_exam.worlds": {
        "deeptruck_exam/worlds/test_worlds.py": "drive drivers",
    },
    "deeptruck_model._imports": {
        "deeptruck_model/checks/test_calls.py": "lazy",
        "deeptruck_model/test_checks.py": "entry_points",
    },
    "deeptruck_model._io": {
        "readers/test_readers.py": "log_kinds reading",
    },
    "deeptruck_model.checks": {
        "deeptruck_model/test_checks.py": "bags compatibility simulators",
    },
    "deeptruck_model.cli": {
        "deeptruck_model/cli/test_topics.py": "inputs",
        "deeptruck_model/fleet/test_compare.py": "fleet",
    },
    "deeptruck_model.compare": {
        "deeptruck_model/compare/test_comparison.py": "naming",
    },
    "deeptruck_model.deep": {
        "deeptruck_model/deep/test_training.py": "card preparation",
    },
    "deeptruck_model.deep.kernels": {
        "deeptruck_model/deep/test_truck.py": "inference layers",
    },
    "deeptruck_model.files": {
        "deeptruck_model/files/test_results.py": "places",
    },
    "deeptruck_model.fmu": {
        "deeptruck_model/fmu/test_foreign.py": "description variables",
    },
    "deeptruck_model.mismatch": {
        "deeptruck_model/fleet/test_compare.py": "evidence_by_name",
        "deeptruck_model/mismatch/test_find.py": "called",
        "deeptruck_model/mismatch/verdict/test_findings.py": "sizes strength",
        "deeptruck_model/mismatch/test_flow.py": "excluded",
    },
    "deeptruck_model.mismatch.expression": {
        "deeptruck_model/mismatch/expression/test_expression.py": "memory places",
    },
    "deeptruck_model.mismatch.mechanisms": {
        "deeptruck_model/mismatch/mechanisms/test_mechanisms.py": (
            "brakes commands driveline engine engine_drag load road"
        ),
    },
    "deeptruck_model.mismatch.residual": {
        "deeptruck_model/mismatch/residual/test_residual.py": "shift_moment",
    },
    "deeptruck_model.pages": {
        "deeptruck_model/compare/test_comparison.py": "document style",
    },
    "deeptruck_model.recordings": {
        "deeptruck_model/recordings/test_bad_bags.py": "bag_file bag_storage mcap_chunks message_definitions",
        "deeptruck_model/recordings/test_recording.py": "recording_figure",
        "deeptruck_model/recordings/test_resample.py": "interpolate",
    },
    "deeptruck_model.recordings.consistency": {
        "deeptruck_model/recordings/tables/test_table_suggestion.py": "proposals",
    },
    "deeptruck_model.recordings.tables": {
        "deeptruck_model/recordings/test_importing.py": "samples",
        "deeptruck_model/recordings/tables/test_table_file.py": "row_keys",
        "deeptruck_model/recordings/tables/test_table_suggestion.py": "row_clock table_form",
    },
    "deeptruck_model.simulators": {
        "deeptruck_model/simulators/test_protocol_check.py": "protocol",
    },
    "deeptruck_model.trucks": {
        "deeptruck_model/trucks/test_reference.py": (
            "brakes engine forces gearbox kernel parameters road start"
        ),
    },
    "truck_bridge": {
        "truck_bridge/test_active_faults.py": "fault_watch",
        "truck_bridge/test_vehicles.py": "channels units",
    },
    "truck_bridge.can_logs": {
        "truck_bridge/test_can_logs.py": "decoding faults importing pieces text_logs trc_logs whole",
    },
    "truck_bridge.emulator": {
        "truck_bridge/emulator/test_ecus.py": "messages sender",
    },
    "truck_bridge.j1939": {
        "truck_bridge/j1939/test_checksums_and_ids.py": "ids",
    },
    "truck_bridge.safety": {
        "safety/test_frames.py": "core",
    },
    "truck_bridge.vehicles": {
        "truck_bridge/test_vehicles.py": "loading schema vehicle",
    },
}


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
    for package in ("deeptruck_model", "deeptruck_exam", "deeptruck_cacc", "truck_bridge"):
        for path in (SOURCE / package).rglob("*.py"):
            place = path.relative_to(SOURCE).with_suffix("")
            module = ".".join(place.parts)
            mirrored = TESTS / place.parent / f"test_{place.name.strip('_')}.py"
            if path.name[:2] != "__" and module not in own and not mirrored.exists():
                alone.add(module)
    listed = {
        f"{room}.{name}"
        for room, through in THROUGH.items()
        for names in through.values()
        for name in names.split()
    }
    missing = sorted(alone - listed)
    assert not missing, f"write a test of their name, or list the test that runs them: {missing}"
    assert not [m for m in listed if not (SOURCE / m.replace(".", "/")).with_suffix(".py").exists()]
    tests = {test for through in THROUGH.values() for test in through}
    assert not [test for test in tests if not (TESTS / test).exists()]

"""What a simulator says of itself, before anything heavy is imported."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import simulator_facts as facts
from deeptruck_model import simulators, trucks
from deeptruck_model.manifest import MANIFEST


def test_simulators_tell_what_they_are(tmp_path: Path) -> None:
    for name in trucks.pool():
        truck = simulators.load(f"truck:{name}")
        said = facts.simulator(f"truck:{name}")
        assert (said.interface, said.dt, said.kind) == (truck.interface, truck.dt, "physics")
        truck.save(tmp_path / name)
        assert facts.simulator(str(tmp_path / name)).interface == truck.interface
    (tmp_path / "light.yaml").write_text("interface: {grade: false}\nmass: 12000\n")
    assert not facts.simulator(f"truck:volvo:{tmp_path / 'light.yaml'}").interface.grade


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("truck:truksim", "there is no truck 'truksim'; did you mean trucksim"),
        ("truck:trucksim:mass=-1", "mass=-1 cannot be read: it does not exist; give a YAML file of"),
        ("truck:trucksim:{dir}/heavy.yaml", "parameter 'mass' is -1 kg, not 1000 to 250000"),
        ("truck:trucksim:{dir}/none.yaml", "none.yaml cannot be read: it does not exist"),
        ("{dir}/none", "none does not exist"),
        (__file__, "is a Python file; give it as python:test_simulator_facts:FACTORY from its folder"),
        ("{dir}/empty", "is not a simulator directory: it has no simulator.json"),
        ("{dir}/odd", "has no known kind; installed are corrected, deep, outside, physics"),
        ("{dir}/cut", "simulator.json is damaged"),
        ("{dir}/bare", "simulator.json is damaged"),
        ("{dir}/weightless", "has lost model.safetensors"),
    ],
)
def test_a_simulator_that_cannot_be_used_is_one_line(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "heavy.yaml").write_text("mass: -1\n")
    content = {
        "empty": None,
        "odd": '{"kind": "tram"}',
        "cut": '{"kind": "deep", ',
        "bare": '{"kind": "physics"}',
        "weightless": '{"kind": "deep"}',
    }
    for name, manifest in content.items():
        (tmp_path / name).mkdir()
        if manifest is not None:
            (tmp_path / name / MANIFEST).write_text(manifest)
    with pytest.raises(InputError, match=says) as caught:
        facts.simulator(text.format(dir=tmp_path))
    assert "\n" not in str(caught.value)


def test_looking_imports_nothing_heavy(tmp_path: Path) -> None:
    (tmp_path / "light.yaml").write_text("mass: 12000\n")
    code = (
        "import json, sys\nfrom deeptruck_model import simulator_facts as facts\n"
        f"facts.simulator({'truck:volvo:' + str(tmp_path / 'light.yaml')!r})\n"
        "heavy = {'torch', 'numba', 'scipy', 'matplotlib', 'rosbags', 'mcap'} & set(sys.modules)\n"
        "print(json.dumps(sorted(heavy)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == []

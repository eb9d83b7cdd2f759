"""What simulators and bags say of themselves in manifests and metadata."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model import checks, simulators, trucks
from deeptruck_model.checks.compatibility import Taken
from deeptruck_model.recordings import Recording, write_bag
from deeptruck_model.recordings.several import check_fit

TRUCK = TruckInterface("trucksim")


def bag_of(path: Path, interface: TruckInterface = TRUCK) -> Path:
    names = {"speed", "acceleration", *interface.u, *interface.w}
    channels = {name: np.zeros(30) for name in sorted(names)}
    return write_bag(path, [Recording(path.name, 0.1, channels, interface)], interface=interface)


def test_a_bag_tells_its_interface_and_topics(tmp_path: Path) -> None:
    one = checks.bag(bag_of(tmp_path / "drive"))
    assert one.interface == TRUCK and one.messages is not None and one.messages["/truck/twist"] == 30
    alone = checks.bag(next((tmp_path / "drive").glob("*.mcap")))
    assert alone.interface is None and alone.messages is None


def test_simulators_tell_what_they_are(tmp_path: Path) -> None:
    for name in trucks.pool():
        truck = simulators.load(f"truck:{name}")
        facts = checks.simulator(f"truck:{name}")
        assert (facts.interface, facts.dt, facts.kind) == (truck.interface, truck.dt, "physics")
        truck.save(tmp_path / name)
        assert checks.simulator(str(tmp_path / name)).interface == truck.interface
    (tmp_path / "light.yaml").write_text("interface: {grade: false}\nmass: 12000\n")
    assert not checks.simulator(f"truck:volvo:{tmp_path / 'light.yaml'}").interface.grade


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("truck:truksim", "there is no truck 'truksim'; did you mean trucksim"),
        ("truck:trucksim:mass=-1", "mass=-1 cannot be read: it does not exist; give a YAML file of"),
        ("truck:trucksim:{dir}/heavy.yaml", "parameter 'mass' is -1 kg, not 1000 to 250000"),
        ("truck:trucksim:{dir}/none.yaml", "none.yaml cannot be read: it does not exist"),
        ("{dir}/none", "none does not exist"),
        (__file__, "is a Python file; give it as python:test_checks:FACTORY from its folder"),
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
            (tmp_path / name / checks.MANIFEST).write_text(manifest)
    with pytest.raises(InputError, match=says) as caught:
        checks.simulator(text.format(dir=tmp_path))
    assert "\n" not in str(caught.value)


def test_a_bag_that_cannot_be_used_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "drive.csv").write_text("time,speed\n0,1\n")
    (tmp_path / "false.mcap").write_text("no bag")
    (tmp_path / "empty").mkdir()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "notes.txt").write_text("x")
    cut = bag_of(tmp_path / "cut")
    (cut / "metadata.yaml").unlink()
    torn = bag_of(tmp_path / "torn")
    (torn / "metadata.yaml").write_text("rosbag2_bagfile_information: {custom_data: [")
    (tmp_path / "several").mkdir()
    bag_of(tmp_path / "several" / "a")
    lost = bag_of(tmp_path / "lost")
    (lost / "lost_0.mcap").unlink()
    says = {
        "none": "does not exist",
        "drive.csv": "needs 'deeptruck-model import'",
        "false.mcap": "cannot be read as a bag",
        "empty": "is empty, it holds no bag",
        "other": "is no bag: it has no",
        "several": "is no bag, but a folder of 1; give these: .*several/[*]",
        "cut": "is not a finished bag",
        "torn": "metadata.yaml is damaged",
        "lost": "has lost lost_0.mcap",
    }
    for name, words in says.items():
        with pytest.raises(InputError, match=words):
            checks.bag(tmp_path / name)


def test_a_recording_that_cannot_drive_a_simulator_is_one_line() -> None:
    taken = Taken("the truck", TRUCK, 0.1)
    channels = {"speed": np.zeros(9), "engine_command": np.zeros(9), "brake_command": np.zeros(9)}
    drive = Recording("monday", 0.1, {**channels, "grade": np.zeros(9)}, TRUCK)
    check_fit([drive], taken)
    percent = TruckInterface("p", engine_unit="percent", brake_unit="bar", grade=False)
    with pytest.raises(InputError) as caught:
        check_fit([drive, Recording("friday", 0.2, channels, percent)], taken)
    for words in (
        "'friday' is sampled every 0.2 s, the truck steps 0.1 s",
        "'friday' has no grade, which the truck needs",
        "'friday' has engine_command in percent, the truck takes N m",
        "'friday' has brake_command in bar, the truck takes percent",
    ):
        assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_every_check_says_is_said_once() -> None:
    def fails() -> None:
        raise InputError("no")

    checks.every(lambda: None)
    with pytest.raises(InputError, match=r"^no$"):
        checks.every(fails, lambda: None, fails)


def test_misfits_of_several_checks_are_counted_once() -> None:
    def fails(says: str) -> None:
        raise InputError(says)

    def both() -> None:
        checks.every(lambda: fails("b"), lambda: fails("c"))

    with pytest.raises(InputError, match=r"^3 things do not fit: \(1\) a \(2\) b \(3\) c$"):
        checks.every(lambda: fails("a"), both)


def test_checks_import_nothing_heavy(tmp_path: Path) -> None:
    bag_of(tmp_path / "drive")
    (tmp_path / "light.yaml").write_text("mass: 12000\n")
    code = (
        "import json, sys\nfrom pathlib import Path\nfrom deeptruck_model import checks\n"
        f"checks.bag(Path({str(tmp_path / 'drive')!r}))\n"
        f"checks.simulator({'truck:volvo:' + str(tmp_path / 'light.yaml')!r})\n"
        "heavy = {'torch', 'numba', 'scipy', 'matplotlib', 'rosbags', 'mcap'} & set(sys.modules)\n"
        "print(json.dumps(sorted(heavy)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == []


@pytest.mark.parametrize("mass_kg", [-1.0, 0.0, float("nan"), float("inf")])
def test_a_mass_that_cannot_be_is_refused_at_once(mass_kg: float) -> None:
    checks.mass(None)
    checks.mass(900.0)
    with pytest.raises(InputError, match="state what the truck weighs"):
        checks.mass(mass_kg)
    with pytest.raises(InputError, match="if 28 t were meant, give 28000"):
        checks.mass(28.0)

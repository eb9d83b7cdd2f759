"""Wrong simulators and bags are told by manifests and metadata alone, all misfits in one line."""

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
from deeptruck_model.checks.compatibility import Given, Taken, misfits
from deeptruck_model.recordings import Recording, write_bag
from deeptruck_model.recordings.topic_map import DEFAULT_TOPICS

TRUCK = TruckInterface("trucksim")


def bag_of(path: Path, interface: TruckInterface = TRUCK, *, without: tuple[str, ...] = ()) -> Path:
    names = {"speed", "acceleration", *interface.u, *interface.w} - set(without)
    channels = {name: np.zeros(30) for name in sorted(names)}
    return write_bag(path, [Recording(path.name, 0.1, channels, interface)], interface=interface)


def test_a_bag_tells_its_interface_and_topics(tmp_path: Path) -> None:
    one = checks.bag(bag_of(tmp_path / "drive"))
    assert one.interface == TRUCK and one.messages is not None
    assert one.messages["/truck/twist"] == 30 and not one.lacks("grade")
    bare = checks.bag(bag_of(tmp_path / "bare", TruckInterface("bare", grade=False)))
    assert bare.lacks("grade") and not bare.lacks("engine_command")


def test_topics_are_those_that_recordings_are_read_from() -> None:
    assert {name: DEFAULT_TOPICS[name].topic for name in checks.TOPICS} == checks.TOPICS


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
        ("truck:trucksim:mass=-1", "'mass=-1' is no file: parameters are replaced by a YAML file"),
        ("truck:trucksim:{dir}/heavy.yaml", "parameter 'mass' is -1 kg, not 1000 to 100000"),
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


def test_all_misfits_come_in_one_line(tmp_path: Path) -> None:
    percent = bag_of(tmp_path / "percent", TruckInterface("p", engine_unit="percent", grade=False))
    bar = bag_of(tmp_path / "bar", TruckInterface("b", brake_unit="bar"))
    fits = bag_of(tmp_path / "fits")
    checks.inputs("truck:trucksim", [fits])
    with pytest.raises(InputError) as caught:
        checks.inputs("truck:trucksim", [percent, bar, fits, tmp_path / "none"])
    line = str(caught.value)
    assert line.startswith("4 things do not fit: (1) ") and "\n" not in line
    for words in (
        "none does not exist",
        "percent has no grade, which the simulator truck:trucksim needs",
        "percent has engine_command in percent, the simulator truck:trucksim takes N m",
        "bar has brake_command in bar, the simulator truck:trucksim takes percent",
    ):
        assert words in line


def test_a_truck_that_follows_a_gear_that_was_not_recorded_may_choose_its_own() -> None:
    taken = Taken("the truck", TruckInterface("t", gear=True), 0.1)
    (line,) = misfits(taken, Given("drive", lambda name: name == "gear", lambda name: None))
    assert line.startswith("drive has no gear, which the truck needs; record it or use another simulator; ")
    assert line.endswith("without '?gear=recorded' behind its name a truck chooses its own gear")


def mapped(**units: str) -> checks.Mapped:
    topics = ("/truck/twist", "/truck/command", "/truck/command", "/road")
    return checks.Mapped(dict(zip(checks.TOPICS, topics, strict=True)), units)


def test_a_topic_map_is_judged_as_the_bag_is(tmp_path: Path) -> None:
    percent = bag_of(tmp_path / "percent", TruckInterface("p", engine_unit="percent"))
    fits = bag_of(tmp_path / "fits")
    checks.inputs("truck:trucksim", [percent, fits], mapped=mapped(engine_command="N m"))
    with pytest.raises(InputError, match="fits has engine_command in percent, the simulator"):
        checks.inputs("truck:trucksim", [fits], mapped=mapped(engine_command="percent"))
    only_speed = checks.Mapped({"speed": "/truck/twist"}, {})
    with pytest.raises(InputError, match="fits has no engine_command, brake_command, grade, which"):
        checks.inputs("truck:trucksim", [fits], mapped=only_speed)
    with pytest.raises(InputError, match="no bag has an engine_command"):
        checks.same_truck([fits], mapped=only_speed)
    elsewhere = checks.Mapped({"speed": "/odom"}, {})
    with pytest.raises(InputError, match="no message on /odom, where the topic map has 'speed'"):
        checks.bag(fits, mapped=elsewhere)
    checks.same_truck([fits, percent], mapped=mapped(engine_command="N m", brake_command="percent"))


def test_bags_of_two_trucks_are_not_trained_on_together(tmp_path: Path) -> None:
    percent = bag_of(tmp_path / "percent", TruckInterface("p", engine_unit="percent"))
    fits = bag_of(tmp_path / "fits")
    checks.same_truck([fits, fits])
    with pytest.raises(InputError, match=r"engine_command in percent, .*fits in N m"):
        checks.same_truck([fits, percent])
    silent = bag_of(tmp_path / "silent", without=("engine_command", "brake_command"))
    checks.same_truck([fits, silent])
    with pytest.raises(InputError, match="no bag has an engine_command"):
        checks.same_truck([silent])


def test_a_lone_file_is_taken_at_its_word(tmp_path: Path) -> None:
    file = next(bag_of(tmp_path / "drive").glob("*.mcap"))
    one = checks.bag(file)
    assert one.interface is None and one.messages is None and not one.lacks("grade")


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
        f"checks.inputs('truck:trucksim', [Path({str(tmp_path / 'drive')!r})])\n"
        "light = 'numpy' not in sys.modules\n"
        f"checks.simulator({'truck:volvo:' + str(tmp_path / 'light.yaml')!r})\n"
        "heavy = {'torch', 'numba', 'scipy', 'matplotlib', 'rosbags', 'mcap'} & set(sys.modules)\n"
        "print(json.dumps([light, sorted(heavy)]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == [True, []]


@pytest.mark.parametrize("mass_kg", [-1.0, 0.0, float("nan"), float("inf")])
def test_a_mass_that_cannot_be_is_refused_at_once(mass_kg: float) -> None:
    checks.mass(None)
    checks.mass(900.0)
    with pytest.raises(InputError, match="state what the truck weighs"):
        checks.mass(mass_kg)
    with pytest.raises(InputError, match="if 28 t were meant, give 28000"):
        checks.mass(28.0)

"""What `python:` names is found and called, or refused in one line before and after its code runs."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import simulator_facts as facts
from deeptruck_model import simulators
from deeptruck_model.outside import reference


def test_the_factory_is_called_with_the_arguments(shuttle: Path) -> None:
    Path("heavy.yaml").write_text("mass: 30000\n")
    plain, heavy = f"python:{shuttle.stem}:make", f"python:{shuttle.stem}:make:heavy.yaml"
    assert simulators.load(plain).parameters()["mass"] == 20000.0
    assert simulators.load(heavy).parameters()["mass"] == 30000.0
    said = facts.simulator(heavy)
    assert (said.interface.name, said.dt, said.kind) == ("shuttle", 0.1, "outside")


MODULE = """
import sys
from deeptruck_core.errors import InputError
NUMBER = 5
def raises(): raise RuntimeError("no licence\\nleft")
def refuses(): raise InputError("no licence; buy one")
def leaves(): sys.exit("bye")
def nothing(): return None
class Half:
    interface = "mine"
    dt = 0.0
    def step(self, state, u, w): ...
    def parameters(self): return {"mass": 1.0}
"""


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("python::make", "names no factory; give python:PACKAGE.MODULE:FACTORY"),
        ("python:{m}", "names no factory"),
        ("python:{m}:a b", "names no factory"),
        ("python:none_such:make", "there is no module none_such"),
        ("python:{m}.none_such:make", "there is no module"),
        ("python:{m}.py:make", "name it without '.py'"),
        ("python:{m}:make", "make is not there in"),
        ("python:{m}:NUMBER", "NUMBER is no function or class"),
        ("python:{m}:raises", r"raises\(\) raised RuntimeError at \w+.py:5 \(no licence left\); mend it"),
        ("python:{m}:refuses", "refuses: no licence; buy one"),
        ("python:{m}:leaves", r"raised SystemExit at \w+.py:7 \(bye\)"),
        ("python:{m}:nothing", "returns is no simulator: it has no interface; add a deeptruck_core.signals"),
        ("python:{m}:Half", "its interface is a str; make it"),
        ("python:{m}:Half", r"it has no reset; add reset\(y0\) -> state"),
        ("python:{m}:Half", "its dt is 0.0; give s"),
        ("python:{m}:Half", r"it has parameters\(\) and no with_parameters"),
        ("python:{m}:raises:none.yaml", "none.yaml cannot be read: it does not exist"),
        ("python:{m}:raises:list.yaml", "list.yaml must hold 'key: value' pairs"),
        (
            "python:{m}_broken:make",
            r"importing \w+ raised ModuleNotFoundError at .* \(No module named 'gone'\)",
        ),
        ("python:{m}_cut:make", r"raised SyntaxError at \w+_cut.py:1 "),
    ],
)
def test_what_cannot_be_made_is_one_line(shuttle: Path, text: str, says: str) -> None:
    name = f"{shuttle.stem}_other"
    Path(f"{name}.py").write_text(MODULE)
    Path(f"{name}_broken.py").write_text("import gone\n")
    Path(f"{name}_cut.py").write_text("def make(:\n")
    Path("list.yaml").write_text("- 1\n")
    for look in (facts.simulator, simulators.load):
        with pytest.raises(InputError, match=says) as caught:
            look(text.format(m=name))
        assert "\n" not in str(caught.value)


def test_a_lost_module_or_arguments_are_told_before_any_code_runs(shuttle: Path) -> None:
    shuttle.write_text("raise SystemExit('it ran')\n")
    with pytest.raises(InputError, match=r"none\.yaml cannot be read"):
        reference.refer(f"{shuttle.stem}:make:none.yaml")
    assert shuttle.stem not in sys.modules


def test_a_slow_factory_is_called_once_for_the_look_and_the_load(shuttle: Path) -> None:
    with shuttle.open("a") as file:
        file.write("\n\nCALLS = []\n\n\ndef slow():\n    CALLS.append(1)\n    return make()\n")
    text = f"python:{shuttle.stem}:slow"
    facts.simulator(text)
    facts.simulator(text)
    first = simulators.load(text)
    assert len(sys.modules[shuttle.stem].CALLS) == 1
    assert simulators.load(text) is not first and len(sys.modules[shuttle.stem].CALLS) == 2

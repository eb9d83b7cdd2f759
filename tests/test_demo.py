"""The demo's machinery; the whole of it is a long test."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))  # `examples` is no part of the installed packages

from examples.demo import runner  # noqa: E402
from examples.demo.runner import StepError, run  # noqa: E402
from examples.demo.steps import DEMO, Settings, Step, plan  # noqa: E402


def demo(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, ROOT / "demo.py", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)


@pytest.mark.long
@pytest.mark.timeout(900)
def test_the_whole_demo_over_an_earlier_one(tmp_path: Path) -> None:
    out = tmp_path / "demo"
    with DEMO.in_place(out):  # as one that was ended leaves it
        (out / "notes.txt").write_text("mine")
    done = demo("--out", out, "--quick")
    assert done.returncode == 0, done.stderr
    text = (out / "index.html").read_text()
    sections = ("Mismatch", "Following", "Open loop", "Driving and recording", "Learning")
    assert all(re.search(f"<(h2|summary)>{section}", text) for section in sections)
    hidden = yaml.safe_load((out / "drives" / "hidden.yaml").read_text())
    assert f"Hidden from the tool: {hidden['says']}" in text
    shown = [name for name in re.findall('(?:src|href)="([^"#]+)"', text) if not name.startswith("../")]
    assert len(shown) > 15 and all((out / name).exists() for name in shown)
    assert (out / "notes.txt").read_text() == "mine"


def test_a_folder_that_is_no_demo_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").touch()
    refused = demo("--out", tmp_path)
    assert (refused.returncode, refused.stdout, refused.stderr.count("\n")) == (2, "", 1)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_steps_need_what_comes_from_steps_before_them(tmp_path: Path) -> None:
    seen: set[str] = set()
    for step in plan(tmp_path, Settings()):
        assert step.name not in seen and seen.issuperset(step.needs)
        seen.add(step.name)


def python(code: str) -> tuple[str, ...]:
    return (sys.executable, "-c", code)


def test_each_step_runs_after_those_it_needs_and_overwrites(tmp_path: Path) -> None:
    order = tmp_path / "order"
    write = f"import sys; open({str(order)!r}, 'a').write(sys.argv[1] + '{{}} ')"
    last = Step("last", "", python(write.format("last")), ("first", "middle"))
    middle = Step("middle", "", python(write.format("middle")), ("first",))
    took = run(tmp_path, [last, middle, Step("first", "", python(write.format("first")))])
    assert order.read_text().split() == ["--overwritefirst", "--overwritemiddle", "--overwritelast"]
    assert list(took) == ["first", "middle", "last"]


def test_a_step_that_fails_says_why_and_ends_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "FAREWELL_S", 240.0)  # a busy machine gives the other its time too
    ended, begun = tmp_path / "ended", tmp_path / "begun"
    waits = f"""
import signal, time
from pathlib import Path
signal.signal(signal.SIGINT, signal.default_int_handler)  # as at a terminal, wherever this test runs
try:
    Path({str(begun)!r}).touch()  # no file object, of which the end would swallow the interrupt
    time.sleep(240)
except KeyboardInterrupt:
    open({str(ended)!r}, "w")
"""
    fails = f"""
import sys, time
from pathlib import Path
while not Path({str(begun)!r}).exists(): time.sleep(0.02)
sys.exit("no such truck")
"""
    steps = [
        Step("bad", "", python(fails)),
        Step("other", "", python(waits)),
        Step("after", "", (), ("bad",)),
    ]
    with pytest.raises(StepError, match=r"'bad' failed \(exit code 1\): no such truck; .*bad\.log"):
        run(tmp_path, steps)
    assert ended.exists() and not (tmp_path / "logs" / "after.log").exists()

"""The demo's machinery, and the smallest real piece of it."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from deeptruck_core.errors import InputError

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))  # `examples` is no part of the installed packages

from examples.demo import page  # noqa: E402
from examples.demo.figures import following_figure  # noqa: E402
from examples.demo.following import Following  # noqa: E402
from examples.demo.runner import Runner, StepError, last_line  # noqa: E402
from examples.demo.steps import Settings, Step, chosen, plan, real_data  # noqa: E402


def demo(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, ROOT / "demo.py", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=240, check=False, cwd=ROOT)


def test_the_smallest_piece_ends_in_a_page(tmp_path: Path) -> None:
    done = demo("--out", tmp_path / "demo", "--quick", "--only", "mismatch")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "demo" / "index.html").read_text()
    assert "Mismatch" in text and "Following" not in text
    hidden = yaml.safe_load((tmp_path / "demo" / "drives" / "hidden.yaml").read_text())
    assert f"Hidden from the tool: {hidden['says']}" in text
    assert (
        done.stdout.startswith("step 1 of 2, drive: running") and "step 2 of 2, mismatch: done" in done.stdout
    )
    for shown in ("mismatch/report.html", "logs/drive.log"):
        assert f'"{shown}"' in text and (tmp_path / "demo" / shown).exists()


@pytest.mark.long
def test_the_whole_demo_and_once_more(tmp_path: Path) -> None:
    out = tmp_path / "demo"
    done = demo("--out", out, "--quick")
    assert done.returncode == 0, done.stderr
    text = (out / "index.html").read_text()
    sections = ("Driving and recording", "Learning", "Open loop")
    assert all(f"<summary>{section}" in text for section in sections)
    assert all(f"<h2>{section}" in text for section in ("Mismatch", "Following"))
    shown = [name for name in re.findall('(?:src|href)="([^"#]+)"', text) if not name.startswith("../")]
    assert len(shown) > 15 and all((out / name).exists() for name in shown)
    (out / "notes.txt").write_text("mine")
    again = demo("--out", out, "--quick", "--again", "evaluate")
    assert again.returncode == 0, again.stderr
    states = dict(re.findall(r"step \d+ of \d+, (\w+): (done|kept)", again.stdout))
    assert {name for name, state in states.items() if state == "done"} == {"evaluate"}
    assert (out / "notes.txt").read_text() == "mine"


def test_commands_are_shown_without_absolute_paths() -> None:
    step = Step(
        "a", "", ("/bin/tool", str(Path.cwd() / "demo"), f"x:path={Path.cwd() / 'y'}", str(Path.cwd().parent))
    )
    assert step.typed == "tool demo x:path=y .."


def test_intervals_that_hold_too_little_are_owned_up_to() -> None:
    def said(*shares: float) -> str:
        return page._intervals({"rows": [("speed", "m/s", {"inside_90": share}) for share in shares]})

    assert said(0.55, 0.63).startswith("90 % intervals hold 55 to 63 % of the points: they are too narrow")
    assert said(0.88, 0.91) == "90 % intervals hold 88 to 91 % of the points"
    assert said() == ""


@pytest.mark.parametrize(
    ("effect", "validated", "says"),
    [
        (
            "dragging_brake",
            True,
            "was found, and its correction reduces .* from 0.74 to 0.21 m/s",
        ),
        ("dragging_brake", False, "was found; the correction changes .* did not pass validation"),
        ("brake_fade", True, "is one of several causes"),
        ("headwind", True, "was not found"),
    ],
)
def test_the_first_sentence_says_whether_the_hidden_was_found(
    effect: str, validated: bool, says: str
) -> None:
    rivals = {"brake_fade": ["dragging_brake"]}.get(effect, [])
    verdict = {
        "findings": [{"effect": effect, "cannot_be_told_from": rivals}],
        "fit": {"before": {"speed_rmse": 0.74}, "after": {"speed_rmse": 0.21}, "validated": validated},
    }
    assert re.search(
        f"^The hidden dragging brake {says}", page._result({"effect": "dragging_brake"}, verdict)
    )


def test_bad_input_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").touch()
    foreign, unknown = demo("--out", tmp_path), demo("--out", tmp_path / "new", "--only", "fly")
    for run, says in ((foreign, "is no demo"), (unknown, "there is no step 'fly'")):
        assert (run.returncode, run.stderr.count("\n")) == (2, 1)
        assert says in run.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def write(text: str, path: Path) -> tuple[str, ...]:
    return (sys.executable, "-c", f"open({str(path)!r}, 'w').write({text!r})")


@pytest.fixture
def run(tmp_path: Path) -> Callable[..., dict[str, str]]:
    """Run steps in `tmp_path`; the end state of each."""

    def _run(*steps: Step, again: tuple[str, ...] = ()) -> dict[str, str]:
        runner = Runner(tmp_path, steps, lambda progress: None)
        runner.forget(again)
        runner.run()
        return {name: p.state for name, p in runner.progress.items()}

    return _run


def test_what_is_done_is_kept_until_something_before_it_changes(
    tmp_path: Path, run: Callable[..., dict[str, str]]
) -> None:
    first = Step("first", "", write("a", tmp_path / "a"), (), "a")
    second = Step("second", "", write("b", tmp_path / "b"), ("first",), "b")
    assert run(first, second) == {"first": "done", "second": "done"}
    assert run(first, second) == {"first": "kept", "second": "kept"}
    other = Step("first", "", write("aa", tmp_path / "a"), (), "a")
    assert run(other, second) == {"first": "done", "second": "done"}
    assert (tmp_path / "a").read_text() == "aa"
    assert run(other, second, again=("second",)) == {"first": "kept", "second": "done"}
    (tmp_path / "b").unlink()
    assert run(other, second) == {"first": "kept", "second": "done"}


TOY = """
import sys
from pathlib import Path
from deeptruck_core import files
from deeptruck_core.errors import InputError
try:
    with files.Result("a toy").replacing(Path(sys.argv[1]), overwrite=sys.argv[2] == "--overwrite") as draft:
        (draft / "toy").touch()
except InputError as error:
    sys.exit(str(error))
"""


def test_what_no_step_made_survives(tmp_path: Path, run: Callable[..., dict[str, str]]) -> None:
    made = tmp_path / "made"
    step = Step("step", "", (sys.executable, "-c", TOY, str(made)), (), "made")
    made.mkdir()
    (made / "notes.txt").write_text("mine")
    for _ in range(2):
        with pytest.raises(StepError, match=r"holds notes\.txt but no \.deeptruck\.json"):
            run(step)
    assert [path.read_text() for path in made.iterdir()] == ["mine"]


def test_what_a_killed_demo_left_is_done_again(tmp_path: Path, run: Callable[..., dict[str, str]]) -> None:
    """The command had ended, but the demo was killed before it noted so."""
    step = Step("step", "", (sys.executable, "-c", TOY, str(tmp_path / "made")), (), "made")
    run(step)
    mark = tmp_path / "logs" / "step.json"
    mark.write_text(json.dumps({**json.loads(mark.read_text()), "done": None}))
    assert run(step) == {"step": "done"}
    assert run(step) == {"step": "kept"}


def test_a_step_that_fails_says_why_and_is_done_again(
    tmp_path: Path, run: Callable[..., dict[str, str]]
) -> None:
    failing = Step("bad", "", (sys.executable, "-c", "import sys; sys.exit('no such truck')"))
    after = Step("after", "", write("x", tmp_path / "x"), ("bad",), ("x",))
    for _ in range(2):
        with pytest.raises(StepError, match=r"step 'bad' failed \(exit code 1\): no such truck; .*bad\.log"):
            run(failing, after)
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(("resumable", "second"), [(True, "--resume"), (False, "--overwrite")])
def test_a_step_that_was_stopped_goes_on_where_it_can(
    tmp_path: Path, run: Callable[..., dict[str, str]], resumable: bool, second: str
) -> None:
    code = f"import sys; f = open({str(tmp_path / 'told')!r}, 'a+'); f.write(sys.argv[1] + ' ')"
    command = (sys.executable, "-c", f"{code}; raise SystemExit(f.tell() < 15)")  # works the second time
    step = Step("train", "", command, resumable=resumable)
    with pytest.raises(StepError):
        run(step)
    assert run(step) == {"train": "done"}
    assert run(step, again=("train",)) == {"train": "done"}
    assert (tmp_path / "told").read_text().split() == ["--overwrite", second, "--overwrite"]


def test_a_doubtful_result_is_tried_once_more(tmp_path: Path, run: Callable[..., dict[str, str]]) -> None:
    runs = tmp_path / "runs"
    command = (sys.executable, "-c", f"open({str(runs)!r}, 'a').write('x')")
    doubts = lambda: ["handed back"] if runs.read_text() == "x" else []  # noqa: E731
    assert run(Step("can", "", command, doubts=doubts)) == {"can": "done"}
    assert runs.read_text() == "xx"


@pytest.mark.parametrize("late", [0.0, 2.0])
def test_another_vehicle_is_marked_when_the_radar_saw_it(late: float) -> None:
    """Not when it was to come: on a busy machine, the bag begins later or earlier than the leader."""
    time = 0.1 * np.arange(900)
    true_gap = 40.0 + np.sin(time)
    there = (time > 62.95 - late) & (time < 64.45 - late)
    gap = true_gap + 40.0 * there + np.random.default_rng(0).normal(0.0, 0.1, 900)
    gap[there.argmax() + 3] = np.nan
    begin, end = Following("can", time, {"gap": gap}, true_gap, true_gap).another_s or (0.0, 0.0)
    assert (begin, end) == (pytest.approx(63.0 - late), pytest.approx(64.4 - late))
    assert Following("can", time, {"gap": true_gap}, true_gap, true_gap).another_s is None


def test_runs_side_by_side_have_the_time_of_one_leader() -> None:
    """A bag may begin after its leader."""

    def run(began_s: float) -> Following:
        time = 0.1 * np.arange(300)
        leader = 20.0 + np.clip(time + began_s - 15.0, 0.0, 3.0)
        names = ("speed", "leader_speed", "gap", "acceleration", "engine_command", "brake_command")
        channels = dict.fromkeys(names, np.full(300, 40.0)) | {"leader_speed": leader}
        return Following("x", time, channels, np.full(300, 40.0), leader)

    early, late = run(0.0), run(5.5)
    leader, _, second = following_figure([early, late]).axes[0].lines
    assert leader.get_xdata()[np.argmax(leader.get_ydata() > 20.5)] == pytest.approx(15.5, abs=0.2)
    assert second.get_xdata()[0] == pytest.approx(5.5, abs=0.11)


def test_progress_bars_leave_their_last_state(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.write_bytes(b"begun\n\x1b[?25l\rtraining 1/9\r\x1b[2Ktraining \x1b[31m9/9\x1b[0m\n\n")
    assert last_line(log) == "training 9/9"


@pytest.mark.parametrize("settings", [Settings(), Settings.quick()])
def test_steps_need_what_comes_from_others_and_make_different_things(
    tmp_path: Path, settings: Settings
) -> None:
    steps = plan(tmp_path, settings, tmp_path)
    names = [step.name for step in steps]
    assert len(set(names)) == len(names) and all(need in names for step in steps for need in step.needs)
    made = [step.makes for step in steps]
    assert len(set(made)) == len(made)
    assert {step.name for step in chosen(steps, ["can"])} == {"drive", "record", "train", "policy", "can"}
    with pytest.raises(InputError, match="known: drive"):
        chosen(steps, ["fly"])


def test_the_real_truck_is_left_out_where_its_table_is_absent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DEEPTRUCK_REAL_DATA", str(tmp_path))
    assert real_data() is None
    assert "real" not in {step.name for step in plan(tmp_path, Settings(), real_data())}


def test_an_interrupted_step_is_ended_and_done_again(tmp_path: Path) -> None:
    code = "import os, time; print(os.getpid(), flush=True); time.sleep(60)"
    step = Step("long", "", (sys.executable, "-c", code))

    def interrupt(progress: object) -> None:
        if (tmp_path / "logs" / "long.raw").exists() and last_line(tmp_path / "logs" / "long.raw"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Runner(tmp_path, [step], interrupt).run()
    pid = int((tmp_path / "logs" / "long.log").read_text().splitlines()[0])
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
    assert json.loads((tmp_path / "logs" / "long.json").read_text())["done"] is None


def test_a_page_that_the_user_changed_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page.write(tmp_path, [], 60.0)
    page.write(tmp_path, [], 120.0)
    assert not capsys.readouterr().err
    (tmp_path / "index.html").write_text("mine")
    page.write(tmp_path, [], 180.0)
    assert "it is kept as" in capsys.readouterr().err
    assert (tmp_path / "index.html.before").read_text() == "mine"
    assert "<html" in (tmp_path / "index.html").read_text()

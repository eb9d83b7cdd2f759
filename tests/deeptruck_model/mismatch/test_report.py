"""The page: complete for every verdict, offline, legible, and without anything that is not a number."""

from __future__ import annotations

import base64
import html
import io
import re
import shutil
import subprocess
from html.parser import HTMLParser
from types import SimpleNamespace

import matplotlib.image
import numpy as np
import pytest

from deeptruck_model.mismatch import findings, formula, page_text, report
from deeptruck_model.mismatch.causes import Cause, Explanation
from deeptruck_model.mismatch.data_checks import SensorFault
from deeptruck_model.mismatch.evidence import Evidence, Stretch
from deeptruck_model.mismatch.free_model import FreeModel
from deeptruck_model.mismatch.improvement import Errors
from deeptruck_model.mismatch.locate import Regime, Segment
from deeptruck_model.mismatch.mechanisms import LIBRARY, shapes
from deeptruck_model.mismatch.noise import Fit
from deeptruck_model.mismatch.residual import prepare
from deeptruck_model.mismatch.search import Model
from deeptruck_model.mismatch.tool import Mismatch
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import TruckInterface

DT, BLOCK, MASS = 0.1, 2, 20000.0
MEASURE = """<script>
addEventListener("load", () => {
  const frame = document.querySelector("iframe"), inside = frame.contentDocument;
  const loaded = [...inside.images].every(image => image.naturalWidth > 99);
  document.title = [inside.documentElement.scrollWidth, frame.contentWindow.innerWidth, loaded];
});
</script>"""
VERDICTS = (
    "missing_physics",
    "unknown",
    "parameter_error",
    "measurement_fault",
    "nothing_missing",
    "undetermined",
)
PARAMETERS = ("mass", "drag_area")
DRIFTS = {"before": 1.0, "parameters_only": 0.7, "after": 0.2}  # m/s after a free run
CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)


# -- a small drive, and what the tool would have found on it ---------------------------------------


def recording(k: int, seconds: float = 120.0) -> Recording:
    rng = np.random.default_rng(k)
    time = np.arange(round(seconds / DT)) * DT
    speed = 14.0 + 8.0 * np.sin(2 * np.pi * time / 50.0 + k) + rng.normal(0.0, 0.01, len(time))
    acceleration = 8.0 * 2 * np.pi / 50.0 * np.cos(2 * np.pi * time / 50.0 + k)
    channels = {
        "speed": speed,
        "acceleration": acceleration + rng.normal(0.0, 0.03, len(time)),
        "engine_command": np.clip(600.0 + 900.0 * acceleration, 0.0, 1900.0),
        "brake_command": np.clip(-25.0 * (acceleration + 0.3), 0.0, 100.0),
        "grade": 0.02 * np.sin(2 * np.pi * time / 80.0),
        "gear": np.clip(np.round(speed / 2.5), 1, 12),
    }
    return Recording(f"drive <{k}>", DT, channels, TruckInterface("test", "N m", "percent", fuel=False))


def evidence(prepared, force) -> Evidence:
    """Block means as the tool stacks them, with a residual of `force` (from the signals) and noise."""

    def stack(parts):
        return np.concatenate([p[: len(p) // BLOCK * BLOCK].reshape(-1, BLOCK).mean(axis=1) for p in parts])

    names = ("speed", "acceleration", "engine_command", "brake_command", "grade", "gear")
    signals = {n: stack([p.recording.channels[n] for p in prepared]) for n in names}
    signals["time"] = signals["elapsed"] = stack([p.recording.time for p in prepared])
    signals["simulated"] = signals["acceleration"]
    signals["engine"], signals["brake"] = signals["engine_command"] / 1500.0, signals["brake_command"] / 25.0
    signals["drag"], signals["rolling"] = 2e-4 * signals["speed"] ** 2, np.full_like(signals["speed"], 0.05)
    signals["distance"] = np.cumsum(signals["speed"]) * DT * BLOCK
    size = len(signals["speed"]) // len(prepared)
    stretches = tuple(
        Stretch(p.recording.name, k * size, (k + 1) * size, 0.0, k >= len(prepared) - 2)
        for k, p in enumerate(prepared)
    )
    noise = np.random.default_rng(9).normal(0.0, 0.02, len(signals["speed"]))
    sensitivity = {"mass": signals["brake"] - signals["engine"], "drag_area": -signals["drag"]}
    return Evidence(
        DT * BLOCK, stretches, force(signals) + noise, signals["acceleration"], np.zeros(len(noise)),
        np.ones(len(noise), dtype=bool), signals, sensitivity, MASS,
        lambda name, amount: np.zeros(len(noise)),
    )  # fmt: skip


def model(named, e: Evidence, b, free, score: float) -> Model:
    blocks = [s.columns.shape[1] for s in named] + [1] * len(PARAMETERS)
    ends = np.cumsum([0, *blocks])
    names = [s.mechanism.effect for s in named] + [f"parameter:{p}" for p in PARAMETERS]
    layout = tuple((n, slice(int(a), int(z))) for n, a, z in zip(names, ends[:-1], ends[1:], strict=True))
    size = int(ends[-1])
    fit = Fit(
        np.resize(b, size), np.eye(size) * 1e-4, np.zeros(size), score, 0.02, np.zeros(5),
        np.zeros(len(e)), np.zeros(len(e)),
    )  # fmt: skip
    return Model(tuple(named), frozenset(free), fit, score, layout)


def errors(prepared, size: float) -> Errors:
    rng = np.random.default_rng(1)
    steps, windows = 400, 4
    drift = size * np.linspace(0.0, 1.0, steps) * rng.normal(1.0, 0.2, (windows, 1))
    return Errors(
        drift, rng.normal(0.0, 0.05, (windows, steps)), np.array([0, 0, 1, 1]), np.array([60, 600, 60, 600])
    )


FORCES = {
    "missing_physics": lambda s: -0.3 * s["brake"],
    "unknown": lambda s: 0.08 * np.sin(0.5 * s["speed"]),
    "parameter_error": lambda s: 0.1 * (s["brake"] - s["engine"]),
    "measurement_fault": lambda s: 0.0 * s["speed"],
    "nothing_missing": lambda s: 0.0 * s["speed"],
}


def mismatch(kind: str, count: int = 3) -> Mismatch:
    prepared = tuple(prepare(recording(k), True) for k in range(count))
    if kind == "undetermined":
        reason = "the speed is constant throughout: accelerate between 5 and 25 m/s"
        return Mismatch(verdict(kind, [], caveats=[reason]), None, None, (), (), {}, None, prepared)
    e = evidence(prepared, FORCES[kind])
    x, causes = explanation(kind, e)
    found = [findings.from_cause(c, e, x, {"mass": MASS, "drag_area": 6.0}) for c in causes]
    if kind == "measurement_fault":
        found.append(
            findings.from_sensor(
                SensorFault("acceleration_bias", 0.3, 0.01, "m/s^2", "it reads +0.300 m/s^2")
            )
        )
    if kind == "unknown":
        found[0].data.update(equation="F = 1600 * sin(0.5 * speed)", formula_r2=0.8, depends_on=["speed"])
    rows = [(s.start + 100, s.start + 250) for s in e.stretches]
    segments = [
        Segment(s.name, 20.0, 50.0, 0, 1200.0, a, z, 5.0) for s, (a, z) in zip(e.stretches, rows, strict=True)
    ]
    return Mismatch(
        verdict(kind, found), e, x, tuple(found), tuple(segments if causes else ()),
        {name: errors(prepared, size) for name, size in DRIFTS.items()},
        None, prepared,
    )  # fmt: skip


def explanation(kind: str, e: Evidence) -> tuple[Explanation, list[Cause]]:
    fade = shapes(LIBRARY["brake_fade"], e)[0]
    named = [fade] if kind == "missing_physics" else []
    free = {"mass"} if kind == "parameter_error" else set()
    full = model(named, e, np.array([0.1]), free, 900.0)
    share = {"speed": 0.8, "grade": 0.12, "brake": 0.08}
    left = FreeModel(FORCES[kind](e.signals), 0.8 if kind == "unknown" else -0.01, share, {})
    rivals = (("dragging_brake", 3.0), ("mass", 40.0))
    causes = {
        "missing_physics": [
            Cause("missing_physics", "brake_fade", 90.0, 0.9, 0.8, fade.columns[:, 0], fade, rivals)
        ],
        "unknown": [Cause("missing_physics", "unknown", 90.0, 0.9, 0.9, left.prediction, nearest="headwind")],
        "parameter_error": [Cause("parameter_error", "mass", 90.0, 1.0, 1.0, 0.1 * e.sensitivity["mass"])],
    }.get(kind, [])
    ranking = (
        ("brake_fade", 90.0),
        ("dragging_brake", 87.0),
        ("headwind", 14.0),
        ("turbo_lag", 2.0),
        ("load_slosh", -3.0),
    )
    x = Explanation(
        tuple(causes), full, model([], e, np.zeros(1), free, 810.0), model([], e, np.zeros(1), set(), 700.0),
        left, 60.0 if kind == "unknown" else 0.0, None,
        ranking if causes else (("headwind", 0.1), ("turbo_lag", -2.0)),
    )  # fmt: skip
    return x, causes


def verdict(kind: str, found, caveats=()) -> dict:
    rows = {
        n: {"speed_rmse": s, "acceleration_rmse": 0.05}
        for n, s in (("before", 0.6), ("parameters_only", 0.4), ("after", 0.1))
    }
    fit = {"held_out": ["a"], "horizon_s": 40.0, "windows": 4, "validated": True, **rows}
    fit |= {"improvement_ci95": [0.5, 0.8], "improvement_over_parameters_ci95": [0.1, 0.3]}
    data: dict = {
        "rejected": [{"rule": "speed missing or invalid", "samples": 12}],
        "coverage": "coverage.png",
    }
    if kind == "nothing_missing":
        data["smallest_visible"] = {
            "mass": {"relative": 0.02},
            "steady force all the time": {"newton": 81.234},
        }
    return {
        "schema": 1,
        "verdict": "missing_physics" if kind == "unknown" else kind,
        "findings": [f.data for f in found],
        "segments": [],
        "regimes": [] if kind == "undetermined" else [vars(Regime("brake > 0.3 m/s^2", 0.7, 0.1))],
        "fit": {} if kind == "undetermined" else fit,
        "data": data,
        "caveats": list(caveats),
    }  # fmt: skip


# -- reading a page --------------------------------------------------------------------------------


class Page(HTMLParser):
    """Visible text in order, images, and everything that could be fetched."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.text: list[str] = []
        self.fetched: list[str] = []
        self.images: list[str] = []
        self.tags: list[str] = []
        self._hidden = 0
        self.feed(source)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self._hidden += tag in ("style", "title", "script")
        for name, value in attributes:
            if name in ("src", "href", "srcset", "data", "action", "poster", "background"):
                (self.images if tag == "img" and name == "src" else self.fetched).append(value or "")

    def handle_endtag(self, tag):
        self._hidden -= tag in ("style", "title", "script")

    def handle_data(self, data):
        if data.strip() and not self._hidden:
            self.text.append(" ".join(data.split()))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Folder of each verdict's page, written once."""
    out = {}
    for kind in VERDICTS:
        folder = tmp_path_factory.mktemp(kind)
        found = mismatch(kind)
        report.write(found, folder)
        out[kind] = SimpleNamespace(
            folder=folder, found=found, html=(folder / "report.html").read_text("utf-8")
        )
    return out


def pixels(png: bytes) -> np.ndarray:
    return matplotlib.image.imread(io.BytesIO(png), format="png")


@pytest.mark.parametrize("kind", VERDICTS)
class TestEveryVerdict:
    def test_the_sentence_comes_first(self, written, kind):
        page = Page(written[kind].html)
        assert page.text[0] == page_text.sentence(written[kind].found.verdict)
        assert page.tags[page.tags.index("body") + 1] == "h1"
        assert page.text[0].endswith(".")

    def test_nothing_is_fetched(self, written, kind):
        source = written[kind].html
        page = Page(source)
        assert page.fetched == []
        assert page.images
        assert all(image.startswith("data:image/png;base64,") for image in page.images)
        assert not {"script", "link", "iframe", "object", "embed", "base"} & set(page.tags)
        style = source[source.index("<style>") : source.index("</style>")]
        assert "url(" not in style
        assert "@import" not in style

    def test_every_figure_shows_something_and_lies_beside_the_page(self, written, kind):
        embedded = [base64.b64decode(s.partition(",")[2]) for s in Page(written[kind].html).images]
        files = {p.read_bytes() for p in written[kind].folder.glob("*.png")}
        others = {p.read_bytes() for p in written[kind].folder.glob("*.png") if p.stem != "timeline"}
        assert others <= set(embedded)
        timeline = pixels((written[kind].folder / "timeline.png").read_bytes())
        strips = [pixels(png) for png in embedded if png not in others]
        np.testing.assert_array_equal(np.concatenate(strips), timeline)
        assert (written[kind].folder / "coverage.png").exists()
        for png in files | set(embedded):
            shades = pixels(png)[..., :3]
            assert min(shades.shape[:2]) > 100
            assert shades.std() > 0.02
            assert len(np.unique(shades.reshape(-1, 3)[::7], axis=0)) > 8

    def test_no_value_is_missing(self, written, kind):
        text = " ".join(Page(written[kind].html).text)
        assert not re.search(r"\b(nan|inf|None|NaN|undefined|Infinity|True|False)\b", text)
        assert "{{" not in text
        assert "array(" not in text

    def test_what_to_record_next_and_caveats_are_there(self, written, kind):
        text = Page(written[kind].html).text
        assert "Caveats" in text
        assert "What to record next" in text


def text_of(written, kind: str) -> str:
    return " ".join(Page(written[kind].html).text)


def test_a_group_is_told_with_what_decided_and_the_manoeuvre(written):
    text = text_of(written, "missing_physics")
    assert "It cannot be told from dragging brake." in text
    assert "What decided: against dragging brake" in text
    assert "To tell brake fade from dragging brake:" in text


def test_sizes_come_with_their_interval(written):
    assert re.search(r"mass 2\d{4} kg \(95 %: 2\d{4} to 2\d{4}\)", text_of(written, "parameter_error"))


def test_an_unknown_force_shows_its_formula_and_shape(written):
    text = text_of(written, "unknown")
    assert "F = 1600 * sin(0.5 * speed)" in text
    assert (written["unknown"].folder / "unknown.png").exists()
    assert "80 % of its variance on held-out recordings" in text


def test_nothing_missing_says_what_would_have_been_seen(written):
    text = text_of(written, "nothing_missing")
    assert "a steady force above 81.2 N would have been seen" in text
    assert "The smallest effect that would have been seen" in text
    assert "mass 2.0 %" in text


def test_a_sensor_fault_shows_the_sensors_against_each_other(written):
    assert (written["measurement_fault"].folder / "sensors.png").exists()
    assert text_of(written, "measurement_fault").startswith("A sensor is at fault, not the truck model:")


def test_undetermined_gives_the_reason_and_draws_no_model(written):
    folder = written["undetermined"].folder
    assert {p.name for p in folder.glob("*.png")} == {"timeline.png", "coverage.png"}
    assert "the speed is constant throughout" in text_of(written, "undetermined")


def test_before_and_after_show_parameters_only_beside(written):
    text = text_of(written, "missing_physics")
    assert re.search(r"before 0.6 0.05 parameters only 0.4 0.05 after 0.1 0.05", text)
    assert "The speed error falls by 50 to 80 %" in text
    assert "falls from 0.6 to 0.1 m/s" in text


def test_a_failed_validation_is_said_in_the_first_sentence():
    v = verdict("missing_physics", mismatch("missing_physics").findings)
    v["fit"]["validated"] = False
    assert "no correction proved better on held-out recordings" in page_text.sentence(v)


def test_without_free_runs_the_sentence_says_that_nothing_is_proved():
    v = verdict("missing_physics", mismatch("missing_physics").findings)
    v["fit"] = {"held_out": [], "horizon_s": 40.0, "windows": 0, "validated": False}
    assert "no held-out drive is long enough to prove it" in page_text.sentence(v)


def test_names_that_cannot_be_tested_are_told_with_the_signal_to_record(written):
    assert re.search(
        r"To be able to test [^.]*drafting[^.]*: record gap", text_of(written, "missing_physics")
    )


def test_names_of_recordings_are_text_and_not_markup(written):
    assert "<0>" not in written["missing_physics"].html


def test_more_than_a_dozen_recordings_are_counted_but_not_all_drawn(tmp_path):
    report.write(mismatch("missing_physics", count=13), tmp_path)
    assert "1 more recording is not drawn" in (tmp_path / "report.html").read_text("utf-8")
    height = pixels((tmp_path / "timeline.png").read_bytes()).shape[0]
    assert height < 110 * (12 * 2.9 + 1.0)


def test_the_formula_enters_from_the_evidence():
    found = mismatch("unknown", count=6)
    described = formula.describe(found.evidence, found.explanation)
    assert described["depends_on"][0] == "speed"
    assert "sin" in described["equation"]
    assert described["formula_r2"] > 0.7


@pytest.mark.parametrize(
    ("value", "unit", "ci", "text"),
    [
        (22997.7, "kg", [22836.6, 23158.8], "23000 kg (95 %: 22840 to 23160)"),
        (0.0826, "1", [0.054, 0.111], "0.083 (95 %: 0.054 to 0.111)"),
        (0.0011, "1/K", None, "0.0011 1/K"),
        (0.0, "N", [0.0, 0.0], "0 N"),
        (40.0, "s", None, "40 s"),
        (float("nan"), "N", [float("nan"), 1.0], "unknown N"),
    ],
)
def test_digits_follow_the_interval(value, unit, ci, text):
    assert page_text.measured(value, unit, ci) == text


def test_certainty_is_never_claimed():
    assert page_text.percent(1.0) == "above 99 %"
    assert page_text.percent(0.0) == "below 1 %"
    assert page_text.percent(0.5) == "50 %"


# -- in a browser ----------------------------------------------------------------------------------


@pytest.mark.skipif(
    CHROMIUM is None, reason="no chromium here; install it (apt-get install chromium) to look at the page"
)
@pytest.mark.parametrize("width", [390, 1200])
def test_it_opens_in_a_browser_without_sideways_scrolling(written, tmp_path, width):
    page = tmp_path / "page.html"
    inside = html.escape(written["missing_physics"].html, quote=True)
    page.write_text(f'<iframe width="{width}" height="900" srcdoc="{inside}"></iframe>{MEASURE}', "utf-8")
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
        "--disable-dev-shm-usage", "--no-first-run", "--host-resolver-rules=MAP * ~NOTFOUND",
        f"--user-data-dir={tmp_path / 'profile'}", f"--window-size={width + 50},900",
    ]  # fmt: skip
    dumped = subprocess.run(
        [*command, "--dump-dom", page.as_uri()], capture_output=True, text=True, timeout=120, check=True
    )
    title = re.search(r"<title>(\d+),(\d+),(\w+)</title>", dumped.stdout)
    assert title, dumped.stderr[-500:]
    assert int(title[2]) == width
    assert int(title[1]) <= width
    assert title[3] == "true"
    shot = tmp_path / "shot.png"
    subprocess.run(
        [*command, f"--screenshot={shot}", page.as_uri()], capture_output=True, timeout=120, check=True
    )
    assert pixels(shot.read_bytes())[..., :3].std() > 0.05

"""What the documents tell people to type is understood, what they show runs, and links lead somewhere."""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
import re
import shlex
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType

import pytest
import typer
import yaml
from typer.main import get_command

import deeptruck_cacc.cli
import deeptruck_model.cli
import truck_bridge.cli
from deeptruck_model.cli import spread
from deeptruck_nodes.parameters import schema
from truck_bridge.safety import Timing

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "SECURITY.md",
    ROOT / "examples" / "README.md",
    *sorted(DOCS.rglob("*.md")),
]
TYPER = r"(deeptruck-[a-z]+|truck-bridge|python (ros2_ws|examples|demo)\S*) \S"
SCRIPT = r"python (-m \S+|(benchmarks|tests)/\S+\.py)"  # argparse, or options written out
OTHERS = r"make \w+|\. \S+/activate$|#|$"
RUN_HERE = [DOCS / "tutorial.md", DOCS / "cacc.md", DOCS / "cacc_shield.md"]
RUN_BY = {  # the snippets of other pages need what their own tests have at hand
    "README.md": "tests/deeptruck_model/mismatch/test_docs.py",
    "docs/trucks.md": "tests/deeptruck_model/trucks/test_truck.py",
    "docs/recordings.md": "tests/deeptruck_model/recordings/test_documentation.py",
    "docs/simulators.md": "tests/deeptruck_model/outside/test_minimal.py",
    "docs/deep_model.md": "tests/deeptruck_model/deep/test_commands.py",
    "docs/mismatch.md": "tests/deeptruck_model/mismatch/test_docs.py",
}

WORDS = {  # what control engineers do not say: and what they do. Phrases where one word is ordinary English
    "untold": "without the exogenous inputs, not identified",
    r"(?<!must be )told(?! about)|tells": "distinguished, identified, reported",  # of data; people are told
    "surely|how sure|surer|(is|are|it) sure|unsure of": "with 88 % probability, significantly, uncertainty",
    "likeness": "similarity, classifier probability",
    "strange": "outside the training domain",
    "recogniser": "effect classifier",
    "likest|liker|likeliest": "most probable",
    "suspicion": "unconfirmed hypothesis",
    "refuted": "rejected",
    "what is claimed|claimed (name|effect|finding|cause)s?": "accepted hypothesis, result",
    r"lessons?|(?<!\")(un)?taught": "law set, trained on",
    "fingerprint": "kernel evidence features, hash",
    "law without a name": "nonparametric term, unnamed law",
    "own curve|own form": "nonparametric curve",
    "other form": "form mismatch",
    "comes again": "position-dependent, road position",
    "comes and goes|now and then": "intermittent, transient, occasionally",
    "handed over alone|harms alone": "without recorded exogenous inputs",
    "acts there alone": "held-out-only residual",
    "often off|off for long": "outlier fraction, persistent bias",
    "not told from": "in the credible set with",
    r"what [\w ]{0,30}(is|are) worth": "benefit, gain",
    "mended": "corrected, repaired",
    "(make|makes|made|making) up for|made up by": "compensate",
    "(is|are|was|were) asked for|with the rest": "requested, demanded, residual term added",
    "(left )?beside it|left beside": "with the nuisance terms, next to it, in addition",
    "by the mean": "time average",
    "(fitted|sizes?|good) for driving": "fitted to the output error",
    "(same|newest|every) stretch|stretch of": "segment of a drive, section of road",
    "noticed|(stands?|stood) out": "above the detection limit, outlier, detected",
    "holds? the mean alone": "contains only the average",
    "strays?|allowances?": "leaves, tolerance",
    "levers?|tempers?|tempered": "overall gear ratio, evidence temperature",
    "believe[sd]?": "accept, assume, reported probability",
    "practical": "physically plausible",
    "nobody's part|no form of a mechanism|no mechanism is in|best on all is so": "see the glossary",
    "conceals?|sealed": "hidden, withheld, held-out test set",
    "control (ends|ended)|ends? control": "hands back",  # fall back is to a baseline
    "(hand|hands|handed) over(?! the engine torque)": "fall back, hand back, give",
}


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def blocks(page: Path, language: str) -> list[str]:
    found = re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.S | re.M)
    return [str(block) for block in found]


def shell_lines(page: Path) -> list[str]:
    return [line for block in blocks(page, "bash") for line in block.replace("\\\n", " ").splitlines()]


def started() -> dict[str, str]:
    """The modules behind the console scripts that start nodes, by the scripts' names."""
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    places = {program: target.partition(":")[0] for program, target in scripts.items()}
    return {program: place for program, place in places.items() if place.startswith("deeptruck_nodes.")}


def script(path: Path) -> ModuleType:
    """A script as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def programs() -> dict[str, typer.Typer]:
    """Everything the documents may call, as the parser it calls."""
    model = deeptruck_model.cli.whole()
    known = {
        "deeptruck-model": model,
        "deeptruck-cacc": deeptruck_cacc.cli.app,
        "truck-bridge": truck_bridge.cli.app,
    }
    for program, place in started().items():
        app = typer.Typer()
        app.command()(importlib.import_module(place).main)
        known[program] = known[f"ros2_ws/{place.rpartition('.')[2]}.py"] = app
    for path in [*(ROOT / "examples").rglob("*.py"), ROOT / "demo.py"]:
        text = path.read_text()
        if "def main(" in text:
            app = typer.Typer()
            with pytest.MonkeyPatch.context() as patch:
                patch.syspath_prepend(str(ROOT))
                app.command()(script(path).main)
            known[str(path.relative_to(ROOT))] = app
    return known


def commands(kind: str) -> Iterator[tuple[str, str]]:
    """(page, command line) of every shell block and of every command in a sentence or table."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        prose = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
        quoted = [" ".join(q.split()) for q in re.findall(r"`([^`]+)`", prose)]
        lines = shell_lines(page) + re.findall(r"^    (\S.*)$", text, re.M)
        yield from ((name(page), line) for line in [*lines, *quoted] if re.match(kind, line))


COMMANDS = sorted(set(commands(TYPER)))
SCRIPTS = sorted(set(commands(SCRIPT)))


@pytest.mark.parametrize(("page", "line"), COMMANDS, ids=lambda text: text[:60])
def test_every_command_is_understood(programs: dict[str, typer.Typer], page: str, line: str) -> None:
    words = shlex.split(line, comments=True)
    if words[0] == "python":
        words = words[1:]
    words = [word for word in words if word not in ("--help", "--version")]  # these stop there
    command = get_command(programs[words[0]])
    if hasattr(command, "commands") and words[1:]:
        context = command.make_context(words[0], words[1:2], resilient_parsing=True)
        found = command.get_command(context, words[1])
        assert found is not None, f"{page}: {words[0]} has no command {words[1]}"
        command, words = found, words[1:]
    if len(words) == 1 or any(word.isupper() for word in words):
        return  # a name or a pattern, not a call
    try:
        command.make_context(words[0], spread(words[1:]))
    except Exception as error:  # a sentence may name a command without all it needs, but not wrongly
        if type(error).__name__ != "MissingParameter" or page.endswith("README.md"):
            raise


def source(words: list[str]) -> str:
    """The text of the script, or of the folder of the module, that a call runs."""
    if words[1] != "-m":
        return (ROOT / words[1]).read_text()
    spec = importlib.util.find_spec(words[2])
    assert spec is not None and spec.origin is not None, words[2]
    return "".join(path.read_text() for path in Path(spec.origin).parent.glob("*.py"))


@pytest.mark.parametrize(("page", "line"), SCRIPTS, ids=lambda text: text[:60])
def test_every_script_is_there_and_has_the_options(page: str, line: str) -> None:
    words = shlex.split(line, comments=True)
    if "NODE" in line:
        return  # a pattern
    text = source(words)
    for option in (word for word in words if word.startswith("--")):
        spelled = option.strip("-").replace("-", "_")
        assert f'"{option}"' in text or f"{spelled}:" in text, f"{page}: {option}"


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_block_says_what_it_is_and_is_checked(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert set(re.findall(r"^```(\w+)", text, re.M)) <= {"bash", "python", "yaml"}
    unknown = [line for line in shell_lines(page) if not re.match(f"{TYPER}|{SCRIPT}|{OTHERS}", line)]
    assert not unknown
    pictures = re.findall(r"^```\n(.*?)^```", text, re.S | re.M)
    assert not [block for block in pictures if re.search(f"^({TYPER}|{SCRIPT})", block, re.M)]
    if blocks(page, "python") and page not in RUN_HERE:
        assert page.name in (ROOT / RUN_BY[name(page)]).read_text()


@pytest.mark.parametrize("page", RUN_HERE, ids=lambda page: page.stem)
def test_snippets_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in blocks(page, "python"):
        exec(compile(block, f"{page.name}", "exec"), names)


def test_the_parameters_shown_exist() -> None:
    for block in blocks(DOCS / "nodes.md", "yaml"):
        for node, of_node in yaml.safe_load(block).items():
            assert set(of_node["ros__parameters"]) <= set(schema()[node])


def links(page: Path) -> list[str]:
    """Where links and pictures of a page lead, but for other sites."""
    found = re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8"))
    return [target for target in found if not re.match(r"[a-z]+:", target)]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in links(page):
        path = target.partition("#")[0]
        assert not path or (page.parent / path).is_file(), f"{page.name}: {target}"


@cache
def paths() -> set[str]:
    """Every file and folder of the project that is not built, from its root."""
    roots = ("src", "ros2_ws", "docs", "benchmarks", "tests", "examples", "exam")
    found = [path for root in roots for path in (ROOT / root, *(ROOT / root).rglob("*"))]
    return {name(path) for path in [*found, *ROOT.glob("*.py")] if "__pycache__" not in path.parts}


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_the_source_that_pages_name_is_there(page: Path) -> None:
    prose = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.S | re.M)
    named = set(re.findall(r"`([\w./-]+\.(?:py|js|jinja|dbc))`", prose))
    if page.stem == "architecture":  # rooms, in the first column of a table
        rows = re.findall(r"^\| (`.*?) \|", prose, re.M)
        rooms = {file for row in rows for file in re.findall(r"`([a-z_]+/[\w/]*)`", row)}
        named |= {file.rstrip("/") if file.endswith("/") else f"{file}.py" for file in rooms}
        assert len(named) > 10
    assert not {file for file in named if not any(f"/{path}".endswith(f"/{file}") for path in paths())}


def test_the_pages_that_the_source_names_are_there() -> None:
    files = [*(ROOT / "src").rglob("*.py"), *(ROOT / "exam").rglob("*.py"), *(ROOT / "ros2_ws").glob("*.py")]
    named = {page for path in files for page in re.findall(r"\bdocs/[\w/]+\.md", path.read_text())}
    assert len(named) > 5
    assert not {page for page in named if not (ROOT / page).is_file()}


def test_the_tables_of_pages_are_what_the_source_makes() -> None:
    tables = script(DOCS / "tables.py")
    assert (DOCS / "j1939_signals.csv").read_text(encoding="utf-8") == tables.signals()
    for (page, mark), made in tables.tables().items():
        text = (DOCS / page).read_text(encoding="utf-8")
        assert f"<!-- {mark}: begin -->\n{made}\n<!-- {mark}: end -->" in text, f"{page}: run 'make schemas'"


@cache
def written() -> dict[str, str]:
    """Every source file, page and template by its path."""
    kinds = {".py", ".md", ".jinja", ".yaml", ".html", ".js"}
    roots = (ROOT / root for root in ("src", "ros2_ws/src", "docs", "benchmarks", "examples", "exam"))
    paths = [path for root in roots for path in root.rglob("*") if path.suffix in kinds]
    paths += [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    return {name(path): " ".join(path.read_text(encoding="utf-8").split()) for path in paths}


@pytest.mark.parametrize("word", WORDS)
def test_the_terms_are_those_of_the_field(word: str) -> None:
    found = [path for path, text in written().items() if re.search(rf"\b({word})\b", text, re.I)]
    assert not found, f"not '{word}' but {WORDS[word]}"


def test_the_layers_of_the_safety_core_name_tests_that_exist() -> None:
    text = (ROOT / "docs" / "safety_core.md").read_text()
    tests = "".join(path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))
    files = {path.stem for path in (ROOT / "tests").rglob("test_*.py")}
    named = set(re.findall(r"`(test_\w+)", text)) - files
    assert len(named) > 15
    missing = [name for name in named if f"def {name}" not in tests]
    assert missing == []


def test_the_table_of_times_is_that_of_the_core() -> None:
    text = (ROOT / "docs" / "vehicle_file.md").read_text().split("## Times of the core")[1]
    rows = re.findall(r"^\| `(\w+)` \| ([\d.]+) \| (.+) \| (.+) \|$", text, re.MULTILINE)
    assert {name: float(value) for name, value, *_ in rows} == dataclasses.asdict(Timing())

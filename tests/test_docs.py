"""What the documents tell people to type is understood, what they show runs, and links lead somewhere."""

from __future__ import annotations

import importlib.util
import re
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest
import typer
from deeptruck_nodes.parameters import schema
from deeptruck_nodes.topics import TOPICS
from typer.main import get_command

import deeptruck_cacc.cli
import truck_bridge.cli
from deeptruck_model.cli import data, deep, mismatch, spread

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
CALL = re.compile(r"(deeptruck-model|deeptruck-cacc|truck-bridge|python (ros2_ws|examples|demo)\S*) \S")
RUN_HERE = [ROOT / "docs" / "tutorial.md"]  # other pages' snippets run in their own room's tests


def blocks(page: Path, language: str) -> list[str]:
    found = re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.S | re.M)
    return [str(block) for block in found]


def script(path: Path) -> ModuleType:
    """A start script as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def programs() -> dict[str, typer.Typer]:
    """Everything the documents may call, as the parser it calls."""
    model = typer.Typer()
    for module in (data, deep, mismatch):
        module.register(model)
    known = {
        "deeptruck-model": model,
        "deeptruck-cacc": deeptruck_cacc.cli.app,
        "truck-bridge": truck_bridge.cli.app,
    }
    for path in [
        *(ROOT / "ros2_ws").glob("*.py"),
        *(ROOT / "examples" / "demo").glob("*.py"),
        ROOT / "demo.py",
    ]:
        text = path.read_text()
        if "def main(" in text:
            app = typer.Typer()
            with pytest.MonkeyPatch.context() as patch:
                patch.syspath_prepend(str(ROOT))
                app.command()(script(path).main)
            known[str(path.relative_to(ROOT))] = app
    return known


def commands() -> Iterator[tuple[str, str]]:
    """(page, command line) of every shell block and of every command in a sentence or table."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        prose = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
        quoted = [" ".join(q.split()) for q in re.findall(r"`([^`]+)`", prose)]
        lines = [line for block in blocks(page, "bash") for line in block.replace("\\\n", " ").splitlines()]
        lines += re.findall(r"^    (\S.*)$", text, re.M)
        for line in [*lines, *quoted]:
            if re.match(
                r"(deeptruck-model|deeptruck-cacc|truck-bridge|python (ros2_ws|examples|demo))\S* \S", line
            ):
                yield str(page.relative_to(ROOT)), line


COMMANDS = sorted(set(commands()))


@pytest.mark.parametrize(("page", "line"), COMMANDS, ids=lambda text: text[:60])
def test_every_command_is_understood(programs: dict[str, typer.Typer], page: str, line: str) -> None:
    words = shlex.split(line, comments=True)
    if words[0] == "python":
        words = words[1:]
    command = get_command(programs[words[0]])
    if words[0] in ("deeptruck-model", "deeptruck-cacc", "truck-bridge"):
        context = command.make_context(words[0], words[1:2], resilient_parsing=True)
        found = command.get_command(context, words[1])  # type: ignore[attr-defined]
        assert found is not None, f"{page}: {words[0]} has no command {words[1]}"
        command, words = found, words[1:]
    if len(words) == 1 or any(word.isupper() for word in words):
        return  # a name or a pattern, not a call
    try:
        command.make_context(words[0], spread(words[1:]))
    except Exception as error:  # a sentence may name a command without all it needs, but not wrongly
        if type(error).__name__ != "MissingParameter" or page.endswith("README.md"):
            raise


def test_commands_were_found() -> None:
    assert len({line for page, line in COMMANDS if page == "README.md"}) >= 9
    assert len(COMMANDS) > 30


@pytest.mark.parametrize("page", RUN_HERE, ids=lambda page: page.stem)
def test_snippets_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in blocks(page, "python"):
        exec(compile(block, f"{page.name}", "exec"), names)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        path, _, anchor = target.partition("#")
        if re.match(r"[a-z]+:", path):
            continue
        found = (page.parent / path).resolve() if path else page
        assert found.exists(), f"{page.name}: {target}"
        if anchor:
            headings = re.findall(r"^#+ (.*)$", found.read_text(encoding="utf-8"), re.M)
            assert anchor in {re.sub(r"[^\w -]", "", h).lower().replace(" ", "-") for h in headings}, target


def test_the_index_names_every_page() -> None:
    index = (ROOT / "docs" / "README.md").read_text()
    pages = {page.name for page in (ROOT / "docs").glob("*.md")} - {"README.md"}
    assert not {name for name in pages if f"]({name})" not in index}


def test_the_picture_of_the_graph_shows_every_node_and_no_topic_that_is_not() -> None:
    picture = (ROOT / "docs" / "figures" / "node_graph.svg").read_text()
    assert set(re.findall(r"(?<![\w<])/[a-z]+(?:/[a-z]+)?\b", re.sub(r"<[^>]*>", " ", picture))) <= set(
        TOPICS
    )
    for node in set(schema()) - {"common"}:
        assert f">{node}<" in picture


def test_the_readme_begins_with_two_commands() -> None:
    head = (ROOT / "README.md").read_text().split("##")[0]
    targets = (ROOT / "Makefile").read_text()
    for name in ("demo", "test"):
        assert re.search(rf"^    make {name}\b", head, re.M) and re.search(rf"^{name}:", targets, re.M)
    assert sys.version_info[:2] in ((3, 11), (3, 12)) and "3.11 or 3.12" in head

"""The page in a browser at the end of a run, and beside a node that hangs; fed without nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import page_browser
import pytest
from page_browser import Page

from deeptruck_core.pages import local
from deeptruck_nodes.page import assets
from deeptruck_nodes.page.live import Link, Live
from deeptruck_nodes.page.server import Server, Stream

pytestmark = pytest.mark.skipif(
    page_browser.CHROMIUM is None, reason="no chromium here; install it (apt-get install chromium) to look"
)
SECOND = 1_000_000_000
WHAT = "truck:trucksim, baseline:acc, 20300101-simulation"
LINKS = (
    Link("/truck/twist", ("truck_sim",), ("leader", "controller")),
    Link("/truck/command", ("controller",), ("truck_sim",)),
    Link("/radar/range", ("leader",), ("controller",)),
)
Ended = Callable[[str], Page]


@pytest.fixture
def ended(tmp_path: Path) -> Iterator[Ended]:
    """A page that has seen a run whose controller hangs, and then what it is told at the end, if anything."""
    with page_browser.opened(tmp_path / "profile") as open_page:

        def after(why: str) -> Page:
            run = Live(("truck_sim", "leader", "controller"), LINKS, {}, WHAT)
            stream = Stream(run.greeting)
            server = Server(found := local.made(), *assets.page(), stream)
            server.start()
            page = open_page(found.address)
            for k in range(50):
                run.received("/truck/twist", 1, 10.0 + k / 10)
                run.sample(k * SECOND // 10, {"speed": 20.0})
                if k < 10:
                    run.received("/truck/command", 1, 10.0 + k / 10)
                    run.sample(k * SECOND // 10, {"engine_command": 700.0})
            run.health(SECOND, "leader", "ok", "driving ahead", {}, 14.9)
            stream.send(run.batch(15.0))
            page.wait("document.getElementById('health').textContent.includes('driving ahead')")
            if why:
                server.close(why)
                page.wait("document.getElementById('link').textContent.includes('has ended')")
                page.wait("document.getElementById('graph').textContent.includes('until the end')")
            return page

        yield after


def legend(page: Page, word: str) -> str:
    find = f"[...document.querySelectorAll('figcaption span')].find(x => x.textContent.startsWith('{word}'))"
    return str(page.get(f"{find}.textContent"))


def test_the_last_command_of_a_hung_controller_is_no_current_value(ended: Ended) -> None:
    page = ended("")
    assert legend(page, "engine command") == "engine command – (700.0 truck's unit 4 s ago)"
    assert legend(page, "truck") == "truck 20.0 m/s"
    assert WHAT in page.get("document.title") and WHAT in page.get("document.querySelector('h1').textContent")


def test_a_planned_end_is_told_calmly(ended: Ended) -> None:
    page = ended("60 s have passed")
    assert "has ended: 60 s have passed, as planned" in page.text("link")
    assert page.get("document.getElementById('link').className") == "over"
    assert page.get("document.querySelectorAll('.bad, .silent, .unheard, .failed').length") == 1  # the key's
    assert page.get("document.body.classList.contains('ended')")
    assert "✓" not in page.text("health") and page.errors == []


def test_a_node_that_failed_is_marked(ended: Ended) -> None:
    page = ended("leader failed")
    assert "✖ The run has ended: leader failed" in page.text("link")
    assert page.text("health").startswith("✖ leader: failed")
    assert page.get("document.getElementById('health').firstChild.className") == "bad"
    marked = "[...document.querySelectorAll('svg .failed')].map(x => x.textContent)"
    assert page.get(marked) == ["✖ leader", "✖ leader"]
    assert page.errors == []

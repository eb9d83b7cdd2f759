"""Assembles the page from the files in this folder, with a policy that lets only these run in it."""

from __future__ import annotations

import base64
import hashlib
from importlib import resources

from deeptruck_core import pages

SCRIPTS = ("strips.js", "graph.js", "page.js")  # in this order: each uses those before it


def page() -> tuple[bytes, str]:
    """The page and its Content-Security-Policy, which allows its own script and style, by hash, and its event
    stream."""
    script = pages.shared(*pages.CHARTS) + "\n".join(map(_read, SCRIPTS))
    style = pages.shared(pages.CHART_STYLE) + _read("page.css")
    text = _read("page.html").replace("/*style*/", style).replace("/*script*/", script)
    policy = (
        f"default-src 'none'; script-src '{_hash(script)}'; style-src '{_hash(style)}'; connect-src 'self'; "
        "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return text.encode(), policy


def _hash(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def _read(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")

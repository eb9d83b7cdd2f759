"""The documentation as a site: `make docs` builds it into build/docs."""

from __future__ import annotations

import re
import sys
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx

ROOT = Path(__file__).parents[1]
sys.path[:0] = [
    str(ROOT / "src"),
    str(ROOT / "ros2_ws" / "src" / "deeptruck_nodes"),
]  # these, not others installed

project = "deeptruck"
author = "deeptruck developers"
copyright = author
release = version = metadata.version("deeptruck")

extensions = ["myst_parser", "sphinx.ext.autodoc"]
source_suffix = {".rst": "restructuredtext", ".md": "markdown"}
root_doc = "index"
html_theme = "furo"
html_math_renderer = "mathml"  # browsers draw it by themselves: the site loads nothing from elsewhere
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_title = f"deeptruck {release}"
html_show_copyright = False
html_copy_source = False
html_show_sphinx = False
suppress_warnings = [
    "toc.not_included"
]  # results/README.md leads to the pages of results, and a test holds it

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

highlight_language = "none"  # of blocks that name no language
default_role = "code"  # docstrings write `name` for code
autodoc_member_order = "groupwise"
autodoc_default_options = {"members": True, "show-inheritance": True}
autodoc_typehints = "signature"
autodoc_type_aliases = {name: name for name in ("Array", "Mask")}
UNREADABLE = r"TypeAliasForwardRef\('(\w+)'\)|<function (\w+)>|<(factory)>"
add_module_names = False
python_maximum_signature_line_length = 90


def mathml(writer: Any, node: nodes.Element) -> None:
    """Write a formula as MathML; `tag` becomes a number behind the formula."""
    tex = re.sub(r"\\tag\{(\d+)\}", r"\\qquad (\1)", node.astext())
    writer.body.append(tex2mathml(tex, as_block=isinstance(node, nodes.math_block)))
    raise nodes.SkipNode


def readable(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """A signature without what Sphinx writes for aliases and default functions."""
    signature, returns = (text and re.sub(UNREADABLE, r"\1\2\3", text) for text in (signature, returns))
    return signature, returns


def load_facades(app: Sphinx) -> None:
    """Names that a package loads on their first use are there for the reference."""
    for page in Path(app.srcdir, "api").glob("*.rst"):
        for name in re.findall(
            r"automodule:: (\S+)\n   :imported-members:", page.read_text(encoding="utf-8")
        ):
            module = import_module(name)
            vars(module).update({public: getattr(module, public) for public in module.__all__})


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("builder-inited", load_facades)
    app.connect("autodoc-process-signature", readable)
    app.add_html_math_renderer("mathml", inline_renderers=(mathml, None), block_renderers=(mathml, None))

"""The snippets of docs/trucks.md run as they stand."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

DOC = Path(__file__).parents[3] / "docs" / "trucks.md"


def test_snippets_run() -> None:
    scope: dict[str, Any] = {}
    blocks = re.findall(r"```python\n(.*?)```", DOC.read_text(), re.DOTALL)
    assert len(blocks) == 3
    for block in blocks:
        exec(block, scope)
    assert len(scope["recording"]) == 4 * 36000
    assert scope["field"].channels["speed"].mean() > 20.0

"""The notebook of the first hour runs from top to bottom, shows what it says, and is kept without outputs.

Its cells are executed in one namespace, as a kernel would: that needs no dependency, and an error names the
cell. What a notebook would show of a cell's last expression is kept.
"""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

NOTEBOOK = Path(__file__).parents[1] / "examples" / "first_hour.ipynb"
CELLS: list[dict[str, Any]] = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
CODE = ["".join(cell["source"]) for cell in CELLS if cell["cell_type"] == "code"]


def shown(source: str, space: dict[str, Any], name: str) -> Any:
    """Execute a cell; the value of its last expression, where it ends in one."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, name, "exec"), space)
    return eval(compile(ast.Expression(last.value), name, "eval"), space) if last is not None else None  # type: ignore[attr-defined]


@pytest.mark.long
@pytest.mark.timeout(900)  # 76 s of CPU time
def test_it_runs_from_top_to_bottom(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    plt.switch_backend("Agg")
    space: dict[str, Any] = {"__name__": "__main__"}
    values = [shown(source, space, f"code cell {k}") for k, source in enumerate(CODE)]
    plt.close("all")
    assert repr(values[3]).startswith("<Recording 'a': ")
    assert sum(hasattr(v, "_repr_png_") or type(v).__name__ == "Figure" for v in values) >= 4
    known, corrected = space["known"], space["corrected"]
    rmse = []
    for truck in (known, corrected):
        error = space["deep"].trials(truck, [space["drives"]["d"]], count=20, horizon_s=60).error[:, 1:, 1]
        rmse.append(float(np.sqrt(np.nanmean(error**2))))
    assert space["found"].findings and rmse[1] < 0.7 * rmse[0]
    followed = space["results"]["sets"]["paper"]
    assert followed["rollouts"] == 10 and np.isfinite(followed["min_gap_m"])

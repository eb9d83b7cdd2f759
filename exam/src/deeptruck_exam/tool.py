"""Runs the tool as a separate process, which gets recordings and a simulator, never the truth."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deeptruck_exam.cases.case import Case

LIMIT_S = 900.0
CONSOLE_SCRIPT = "from deeptruck_model.cli import main; main()"


@dataclass(frozen=True)
class ToolRun:
    """Result of the tool; `verdict` is empty if it failed."""

    returncode: int
    seconds: float
    verdict: dict[str, Any]
    says: str


def run_tool(case: Case, out: Path, *, limit_s: float = LIMIT_S) -> ToolRun:
    """Run `deeptruck-model mismatch` on the case, one thread, with its verdict in `out`."""
    arguments = [
        *(sys.executable, "-c", CONSOLE_SCRIPT, "mismatch"),
        *("--simulator", case.simulator),
        *(part for path in case.paths(case.fit) for part in ("--recordings", str(path))),
        *(part for path in case.paths(case.held_out) for part in ("--held-out", str(path))),
        *(part for name in excluded(case) for part in ("--exclude", name)),
        *("--out", str(out), "--overwrite"),  # what a stopped run left there
    ]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    began = time.monotonic()
    try:
        done = subprocess.run(
            arguments, check=False, env=environment, capture_output=True, text=True, timeout=limit_s
        )
        code, says = done.returncode, (done.stdout + done.stderr)[-4000:]
    except subprocess.TimeoutExpired:
        code, says = 124, f"stopped after {limit_s:g} s"
    path = out / "verdict.json"
    verdict = json.loads(path.read_text()) if code == 0 and path.exists() else {}
    return ToolRun(code, time.monotonic() - began, verdict, says)


def excluded(case: Case) -> list[str]:
    """Effects excluded from the tool's library, as stored with the case: separated by commas."""
    return list(filter(None, case.environment.get("DEEPTRUCK_MISMATCH_EXCLUDE", "").split(",")))


def summary(run: ToolRun) -> dict[str, Any]:
    """Summary of a run on real logs: statements and sizes, free-run speed errors before and after, and the
    budget as shares of the squared speed error by part. Values that the verdict lacks are None."""
    findings, fit = run.verdict.get("findings") or (), run.verdict.get("fit") or {}
    strengths = [f.get("strength") or {} for f in findings]
    budget = run.verdict.get("budget")
    return {
        "verdict": run.verdict.get("verdict", f"failed: {run.says[-200:]}"),
        "said": [str(f["effect"]) for f in findings],
        "sizes": [f"{s['value']:.3g} {s['unit']}" if s else "" for s in strengths],
        "validated": bool(fit.get("validated")),
        "speed_error": (fit.get("before") or {}).get("speed_rmse"),
        "after": (fit.get("after") or {}).get("speed_rmse"),
        "budget": {p["part"]: float(p["share"]) for p in budget["parts"]} if budget else None,
    }

"""The examiner starts the tool as another process and never calls it; tests/test_architecture.py holds the
imports."""

from pathlib import Path

import deeptruck_exam

ROOT = Path(deeptruck_exam.__file__).parent


def test_the_exam_starts_the_tool_as_another_process_only():
    assert "subprocess.run" in (ROOT / "tool.py").read_text()
    assert "find_mismatch" not in "".join(p.read_text() for p in ROOT.rglob("*.py"))

"""The examiner shares nothing with the tool: held over the import graph, lazy imports of the proof
included."""

import ast
from pathlib import Path

import deeptruck_model

ROOT = Path(deeptruck_model.__file__).parent
PACKAGE = "deeptruck_model"


def module_file(name):
    path = ROOT.joinpath(*name.split(".")[1:])
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def imports(path, lazy):
    """Names of our modules a file imports; `lazy` also inside functions."""
    tree = ast.parse(path.read_text())
    nodes = ast.walk(tree) if lazy else tree.body
    found = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports relatively"
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in found if name.split(".")[0] == PACKAGE and module_file(name).exists()}


def of_tool(name):
    return name.startswith(f"{PACKAGE}.mismatch") and not name.startswith(f"{PACKAGE}.mismatch.proof")


def test_nothing_reached_from_the_proof_belongs_to_the_tool():
    proof = sorted((ROOT / "mismatch" / "proof").rglob("*.py"))
    assert len(proof) > 15
    waiting = {name for path in proof for name in imports(path, lazy=True)}
    reached = set()
    while waiting:
        name = waiting.pop()
        reached.add(name)
        if not name.startswith(f"{PACKAGE}.mismatch.proof"):
            waiting |= imports(module_file(name), lazy=False) - reached
    assert f"{PACKAGE}.trucks" in reached
    assert {name for name in reached if of_tool(name)} - {f"{PACKAGE}.mismatch"} == set()
    assert not any(f"{PACKAGE}.mismatch" in imports(path, lazy=True) for path in proof)


def test_the_tool_does_not_import_the_proof():
    tool = [p for p in (ROOT / "mismatch").rglob("*.py") if "proof" not in p.relative_to(ROOT).parts]
    offenders = [p for p in tool if any(".mismatch.proof" in name for name in imports(p, lazy=True))]
    assert offenders == []


def test_the_proof_starts_the_tool_as_another_process_only():
    text = (ROOT / "mismatch" / "proof" / "tool.py").read_text()
    assert "subprocess.run" in text
    assert "find_mismatch" not in "".join(p.read_text() for p in (ROOT / "mismatch" / "proof").rglob("*.py"))

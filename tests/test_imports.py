"""Who may import whom, and that importing does nothing else."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "agentflow"

ALLOWED = {
    "errors": set(),
    "machine": {"errors"},
    "env": {"errors", "documents", "machine"},
    "llm": {"errors"},
    "prompts": {"errors"},
    "agents": {"errors", "llm", "prompts", "machine"},
    "search": {"errors"},
    "workflows": {"errors", "agents", "search", "machine"},
    "runs": {"errors"},
    "metrics": {"errors", "runs"},
    "report": {"errors", "runs", "metrics"},
    "documents": {"errors"},
    "config": {"errors", "documents", "workflows", "llm"},
    "sweeps": {"errors", "documents", "config"},
    "store": {"errors", "machine", "env", "laboratory"},
    "laboratory": {"machine", "env", "search", "workflows"},
    "rewards": {"machine", "env"},
    "cli": {"errors", "app", "config", "runs"},
}
"""Part -> parts it may import; `app` may import all. Keep it as CONTRIBUTING.md draws it."""

WITHIN_APP: dict[str, set[str]] = {
    "outputs": set(),
    "machines": {"outputs"},
    "tasks": set(),
    "prompts": set(),
    "runs": set(),
    "records": {"runs"},
    "sweeps": {"runs"},
    "pages": {"outputs", "machines", "tasks", "runs", "records", "sweeps"},
    "python": {"machines", "runs"},
    "configuration": {"runs"},
    "doctor": {"runs"},
}
"""The same for the parts of `app`."""

FILES = sorted(PACKAGE.rglob("*.py"))


def part_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported(path: Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.add(node.module or "")
        elif isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
    return names


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_one_way(path: Path) -> None:
    part = part_of(path)
    names = imported(path)
    ours = {name.split(".")[1] for name in names if name.startswith("agentflow.")}
    if part not in ("__init__", "app"):
        allowed = set(ALLOWED[part]) | {part}
        if "procedural" in path.parts:
            allowed.add("machine")
        assert ours <= allowed, f"{part} imports {sorted(ours - allowed)}"
    if part == "app" and path.name != "__init__.py":
        own = path.relative_to(PACKAGE).parts[1].removesuffix(".py")
        used = {name.split(".")[2] for name in names if name.startswith("agentflow.app.")}
        assert used <= {*WITHIN_APP[own], own}, f"app/{own} imports {sorted(used)}"
    if not path.is_relative_to(PACKAGE / "env" / "engines"):
        assert not any(name.split(".")[0].startswith("pybullet") for name in names)


@pytest.mark.slow
def test_importing_everything_prints_nothing() -> None:
    modules = [
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")
        for path in FILES
        if path.name != "__main__.py"
    ]
    code = "import importlib\n" + "\n".join(
        f"importlib.import_module({name!r})" for name in modules
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")

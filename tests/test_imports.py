"""Who may import whom, and that importing does nothing else."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "agentflow"

CONTRIBUTING = PACKAGE.parent / "CONTRIBUTING.md"


def rules(heading: str) -> dict[str, set[str]]:
    """A table of CONTRIBUTING.md: part -> parts it may import."""
    after = CONTRIBUTING.read_text(encoding="utf-8").split(f"{heading}\n", 1)[1]
    section = after.partition("\n#")[0]
    rows = re.findall(r"^\| `(\w+)` \|(.*)\|$", section, re.MULTILINE)
    return {
        part: set(re.findall(r"`([\w.]+)`", allowed.partition("(")[0])) for part, allowed in rows
    }


ALLOWED = rules("## Who may import whom")
WITHIN_APP = rules("### Within `app`")
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


def may(module: str, allowed: set[str]) -> bool:
    """Whether a module of ours is one of the allowed parts, or within one."""
    return any(module == part or module.startswith(f"{part}.") for part in allowed)


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_one_way(path: Path) -> None:
    part = part_of(path)
    names = imported(path)
    ours = {name.removeprefix("agentflow.") for name in names if name.startswith("agentflow.")}
    if part in ALLOWED:
        allowed = ALLOWED[part] | {part}
        if "procedural" in path.parts:
            allowed |= {"machine"}
        against = sorted(name for name in ours if not may(name, allowed))
        assert not against, f"{part} imports {against}"
    else:
        assert part in ("__init__", "app"), f"CONTRIBUTING.md does not say what {part} may import"
    if part == "app" and path.name != "__init__.py":
        own = path.relative_to(PACKAGE).parts[1].removesuffix(".py")
        used = {name.split(".")[1] for name in ours if name.startswith("app.")}
        assert used <= {*WITHIN_APP[own], own}, f"app/{own} imports {sorted(used)}"
    if part != "cluster":
        assert not any(name.split(".")[0] == "ray" for name in names)
    for engine in ("pybullet", "mujoco"):
        if not path.is_relative_to(PACKAGE / "env" / "physics" / engine):
            assert not any(name.split(".")[0].startswith(engine) for name in names)
            assert not any(name.startswith(f"env.physics.{engine}") for name in ours)


def test_every_stated_rule_is_about_a_part_that_exists() -> None:
    parts = {part_of(path) for path in FILES} - {"__init__"}
    assert set(ALLOWED) == parts - {"app"}
    inside = {
        path.relative_to(PACKAGE / "app").parts[0].removesuffix(".py")
        for path in FILES
        if part_of(path) == "app"
    }
    assert set(WITHIN_APP) == inside - {"__init__", "__pycache__"}


def adapts_what_is_missing(path: Path) -> bool:
    """Whether an adapter needs the library that it is named after, which is not installed here."""
    if part_of(path) != "integrations":
        return False
    name = path.relative_to(PACKAGE / "integrations").parts[0].removesuffix(".py")
    own = [file for file in FILES if name in (file.stem, file.parent.name)]
    needed = {module.split(".")[0] for file in own for module in imported(file)}
    return name in needed and not find_spec(name)


@cache
def needs_what_is_missing(path: Path) -> bool:
    """Whether importing a module needs a library of an extra that is not installed here."""
    if part_of(path) not in ("training", "cluster"):
        return False
    tree = ast.parse(path.read_text())
    names = {node.module or "" for node in tree.body if isinstance(node, ast.ImportFrom)}
    for node in tree.body:
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
    if not all(find_spec(name.split(".")[0]) for name in names):
        return True
    files = (PACKAGE.parent / (name.replace(".", "/") + ".py") for name in names)
    return any(needs_what_is_missing(file) for file in files if file in FILES)


@pytest.mark.slow
def test_importing_everything_prints_nothing() -> None:
    modules = [
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")
        for path in FILES
        if path.name != "__main__.py"
        and not adapts_what_is_missing(path)
        and not needs_what_is_missing(path)
    ]
    code = "import importlib\n" + "\n".join(
        f"importlib.import_module({name!r})" for name in modules
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_a_folder_has_at_most_twelve_modules() -> None:
    crowded = {}
    for folder in {path.parent for path in FILES}:
        count = sum(path.name != "__init__.py" for path in folder.glob("*.py"))
        if count > 12:
            crowded[str(folder.relative_to(PACKAGE))] = count
    assert crowded == {}

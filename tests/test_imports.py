"""Who may import whom, and that importing does nothing else."""

from __future__ import annotations

import ast
import re
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.loops import for_each
from tests.processes import run_python

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
CAD = {"OCP", "manifold3d", "trimesh", "pxr"}
"""Libraries of the extra `cad`."""


def part_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(ast.parse(path.read_text())))


def imported(path: Path) -> set[str]:
    names: set[str] = set()
    for node in nodes(path):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.add(node.module or "")
        elif isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
    return names


def may(module: str, allowed: set[str]) -> bool:
    """Whether a module of ours is one of the allowed parts, or within one."""
    return any(module == part or module.startswith(f"{part}.") for part in allowed)


@for_each(FILES)
def test_imports_point_one_way(path: Path) -> None:
    part = part_of(path)
    names = imported(path)
    assert PACKAGE.name not in names, f"{path}: name the module that has it, not the package"
    ours = {name.removeprefix("agentflow.") for name in names if name.startswith("agentflow.")}
    if part != "__init__":
        assert part in ALLOWED, f"CONTRIBUTING.md does not say what {part} may import"
        allowed = ALLOWED[part] | {part}
        if "procedural" in path.parts:
            allowed |= {"machine"}
        against = sorted(name for name in ours if not may(name, allowed))
        assert not against, f"{part} imports {against}"
    if part == "app" and path.name != "__init__.py":
        own = path.relative_to(PACKAGE).parts[1].removesuffix(".py")
        used = {name.split(".")[1] for name in ours if name.startswith("app.")}
        assert used <= {*WITHIN_APP[own], own}, f"app/{own} imports {sorted(used)}"
    if part != "cluster":
        assert not any(name.split(".")[0] == "ray" for name in names)
    if part != "making":
        assert not {name.split(".")[0] for name in names} & CAD
    for engine in ("pybullet", "mujoco"):
        if not path.is_relative_to(PACKAGE / "env" / "physics" / engine):
            assert not any(name.split(".")[0].startswith(engine) for name in names)
            assert not any(name.startswith(f"env.physics.{engine}") for name in ours)


def module_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


MODULES = set(map(module_of, FILES))


def used_by(path: Path) -> set[str]:
    """The modules of ours that a module imports anywhere: also in functions, and for types only."""
    names: set[str] = set()
    for node in nodes(path):
        if isinstance(node, ast.ImportFrom):  # what is imported from a package may be a module
            within = {f"{node.module}.{alias.name}" for alias in node.names} & MODULES
            names |= within if len(within) == len(node.names) else {*within, node.module or ""}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return names & MODULES - {module_of(path)}


def require_no_circle(graph: dict[str, set[str]]) -> None:
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail("these import one another: " + " -> ".join(reversed(error.args[1])))


def test_no_modules_import_one_another() -> None:
    require_no_circle({module_of(path): used_by(path) for path in FILES})


def test_no_parts_import_one_another() -> None:
    parts: dict[str, set[str]] = {part_of(path): set() for path in FILES}
    for path in FILES:
        used = {name.split(".")[1] for name in used_by(path) if "." in name}
        parts[part_of(path)] |= used - {part_of(path)}
    require_no_circle(parts)


def test_every_stated_rule_is_about_a_part_that_exists() -> None:
    parts = {part_of(path) for path in FILES} - {"__init__"}
    assert set(ALLOWED) == parts
    inside = {
        path.relative_to(PACKAGE / "app").parts[0].removesuffix(".py")
        for path in FILES
        if part_of(path) == "app"
    }
    assert set(WITHIN_APP) == inside - {"__init__", "__pycache__"}


def test_every_module_in_the_tables_exists() -> None:
    named = {name for allowed in ALLOWED.values() for name in allowed}
    assert {name for name in named if f"{PACKAGE.name}.{name}" not in MODULES} == set()


def test_the_drawn_layout_is_that_of_the_package() -> None:
    drawn = CONTRIBUTING.read_text(encoding="utf-8").split("```text\nagentflow/\n", 1)[1]
    above: list[str] = []
    for line in drawn.partition("```")[0].splitlines():
        found = re.match(r"((?:  )+)([a-z_]+(?:/|\.py)) ", line)
        if found:
            above[len(found[1]) // 2 - 1 :] = [found[2]]
            assert PACKAGE.joinpath(*above).exists(), "/".join(above)


@pytest.mark.parametrize("table", [ALLOWED, WITHIN_APP], ids=["parts", "app"])
def test_the_tables_allow_no_circle(table: dict[str, set[str]]) -> None:
    """No part may import one that imports it, not even through others."""
    above = {part: {name.split(".")[0] for name in names} for part, names in table.items()}
    require_no_circle({part: names - {part} for part, names in above.items()})


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
    if part_of(path) not in ("models", "training", "cluster", "making"):
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
        module_of(path)
        for path in FILES
        if path.name != "__main__.py"
        and not adapts_what_is_missing(path)
        and not needs_what_is_missing(path)
    ]
    code = "import importlib\n" + "\n".join(
        f"importlib.import_module({name!r})" for name in modules
    )
    done = run_python("-W", "error", "-c", code)
    assert (done.stdout, done.stderr) == ("", "")


def test_a_folder_has_at_most_twelve_modules() -> None:
    crowded, of_roles = {}, 13
    for folder in {path.parent for path in FILES}:
        count = sum(path.name != "__init__.py" for path in folder.glob("*.py"))
        if count > (of_roles if folder == PACKAGE / "agents" else 12):
            crowded[str(folder.relative_to(PACKAGE))] = count
    assert crowded == {}

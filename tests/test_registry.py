"""Registries: what is in the documentation, and how a wrong part from outside is refused."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import agentflow
from agentflow.agents.base import Role
from agentflow.agents.designer import Designer
from agentflow.agents.registry import ROLES
from agentflow.app.pages.registry import PAGES
from agentflow.env.physics.registry import ENGINES
from agentflow.env.tasks.registry import FAMILIES
from agentflow.errors import PluginError, UnknownNameError
from agentflow.metrics.cells import METRICS
from agentflow.prompts import compact
from agentflow.prompts.registry import PROMPT_SETS
from agentflow.registry import Registry, instance_of, is_callable, package_with, subclass_of
from agentflow.search.registry import STRATEGIES
from agentflow.workflows.registry import WORKFLOWS

DOCS = Path(__file__).parent.parent / "docs"
DOCUMENTED = [
    ("reference/tasks.md", FAMILIES),
    ("explanation/prompts-and-roles.md", ROLES),
    ("explanation/prompts-and-roles.md", PROMPT_SETS),
    ("explanation/search.md", STRATEGIES),
    ("explanation/search.md", WORKFLOWS),
    ("how-to/sweeps.md", METRICS),
]
EVERY = (ENGINES, FAMILIES, METRICS, PAGES, PROMPT_SETS, ROLES, STRATEGIES, WORKFLOWS)


@pytest.mark.parametrize(("page", "registry"), DOCUMENTED)
def test_the_documentation_names_everything(page: str, registry: Registry[Any]) -> None:
    text = (DOCS / page).read_text(encoding="utf-8").lower().replace("-", "_")
    words = set(re.findall(r"\w+", text))
    assert [name for name in registry.ours if name.replace("-", "_") not in words] == []


@pytest.mark.parametrize("registry", EVERY, ids=lambda registry: registry.kind)
def test_everything_of_ours_loads_and_unknown_names_are_refused(registry: Registry[Any]) -> None:
    assert all(registry[name] is not None for name in registry.ours)
    assert tuple(registry)[: len(registry.ours)] == registry.ours
    assert registry.ours[0] in registry
    assert "nobody" not in registry
    with pytest.raises(UnknownNameError, match=rf"^unknown {registry.kind} 'nobody'; known: "):
        registry["nobody"]


@pytest.mark.parametrize(
    ("check", "right", "wrong", "problem"),
    [
        (is_callable, len, 3, "is not a function"),
        (instance_of(int), 3, "3", "is not an instance of builtins.int"),
        (
            subclass_of("agentflow.agents.base:Role", named_by="name"),
            Designer,
            len,
            "is not a subclass of agentflow.agents.base.Role",
        ),
        (subclass_of(Role, named_by="name"), Designer, Role, "has name = None"),
        (package_with("set.yaml"), compact, re, "is not a package with a file set.yaml"),
    ],
)
def test_checks(check: Any, right: Any, wrong: Any, problem: str) -> None:
    assert check("designer", right) == ""
    assert check("designer", wrong) == problem


NAMED = (ENGINES, PROMPT_SETS, STRATEGIES, WORKFLOWS)
"""Registries whose names stand nowhere else; families and roles have such tests of their own."""
ORDINARY = {
    *("compact", "default", "explore", "external", "placement", "random", "single", "tools"),
}
"""Names that are ordinary words too, of which a search for strings tells nothing."""
HOMES = ("env/physics/", "prompts/", "search/", "workflows/")
"""Parts that these consist of."""
EXCEPTIONS = {
    "api.py": "the function of the workflow tune",
    "app/machines/convert.py": "the format of one engine, which writes it",
    "cli/commands/design.py": "the command of the workflow tune",
    "cli/commands/machines.py": "the format of one engine, which writes it",
    "config/run.py": "a default that users read",
    "studio/watching/designs.py": "a default that users read",
}
"""Modules elsewhere that name one of these parts, and why."""


def test_names_of_registered_parts_have_one_place() -> None:
    package = Path(agentflow.__file__).parent
    names = {name for registry in NAMED for name in registry.ours} - ORDINARY
    quoted = re.compile(rf"([\"'])({'|'.join(map(re.escape, names))})\1")
    files = {path.relative_to(package).as_posix(): path for path in package.rglob("*.py")}
    others = {name: path for name, path in files.items() if not name.startswith(HOMES)}
    naming = {name for name, path in others.items() if quoted.search(path.read_text("utf-8"))}
    assert naming == set(EXCEPTIONS)


def test_the_identity_of_a_part_from_elsewhere_covers_its_sources(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []
    for name, size in (("idle_one", 1), ("idle_two", 1), ("idle_three", 2)):
        monkeypatch.syspath_prepend(_distribution(tmp_path, name, "run = len\n" * size))
    registry = Registry("search strategy", "agentflow.strategies", {"ours": len}, is_callable)
    for name in ("idle_one", "idle_two", "idle_three"):
        identity = registry.identity(name)
        assert identity.startswith(f"{name} 1.0 source ")
        found.append(identity.rpartition(" ")[2])
    assert found[0] == found[1] != found[2]
    assert registry.identity("ours") == registry.identity("nobody") == ""


FAULTY = """
def run(call):
    if call is None:
        raise KeyError("depth")
    return call()
"""


def test_what_a_part_raises_names_it_and_its_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(_distribution(tmp_path, "faulty_one", FAULTY))
    registry = Registry("search strategy", "agentflow.strategies", {"ours": len}, is_callable)
    part: Any = registry["faulty_one"]
    with pytest.raises(PluginError) as caught, registry.blaming("faulty_one"):
        part(None)
    assert str(caught.value) == (
        "the search strategy 'faulty_one' (faulty_one:run) of the distribution 'faulty_one' "
        f"failed: {tmp_path}/faulty_one/faulty_one/__init__.py, line 4 raised KeyError: 'depth'"
    )
    with pytest.raises(KeyError), registry.blaming("faulty_one"):
        part(lambda: registry.describe("nobody"))  # a bug of ours that it runs into
    with pytest.raises(KeyError), registry.blaming("ours"):
        part(None)
    with pytest.raises(UnknownNameError), registry.blaming("faulty_one"):
        part(lambda: registry["nobody"])


def _distribution(folder: Path, name: str, code: str) -> Path:
    """A folder with an installed distribution that holds a strategy; all have this one name."""
    place = folder / name
    (place / name).mkdir(parents=True)
    (place / name / "__init__.py").write_text(code)
    info = place / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Name: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[agentflow.strategies]\n{name} = {name}:run\n")
    return place

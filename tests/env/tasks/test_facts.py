"""What the package knows of a family is said by the family: no other module names one."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from agentflow.env.tasks.family import Family
from agentflow.env.tasks.registry import FAMILIES

PACKAGE = Path(__file__).parents[3] / "agentflow"
OWN = (Path("env/tasks/families"), Path("env/tasks/registry.py"))
DEFAULT = "what is done unless the user names a task"
EXCEPTIONS = {
    "cli/commands/agents.py": DEFAULT,
    "cli/commands/machines.py": DEFAULT,
    "cli/commands/tasks.py": DEFAULT,
    "config/run.py": DEFAULT,
    "integrations/openenv.py": DEFAULT,
    "integrations/verifiers/tasks.py": DEFAULT,
    "training/grpo/config.py": DEFAULT,
}
NAME = re.compile(rf"({'|'.join(FAMILIES.ours)})(/\d+)?")
"""A family or a level of one."""


def named(path: Path) -> set[str]:
    """The families and levels that are whole texts in a module; sentences do not count."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    texts = (node.value for node in ast.walk(tree) if isinstance(node, ast.Constant))
    return {text for text in texts if isinstance(text, str) and NAME.fullmatch(text)}


def test_no_module_names_a_family_without_a_reason() -> None:
    modules = [path.relative_to(PACKAGE) for path in sorted(PACKAGE.rglob("*.py"))]
    found = {
        path.as_posix(): names
        for path in modules
        if not any(path.is_relative_to(own) for own in OWN) and (names := named(PACKAGE / path))
    }
    assert {name: names for name, names in found.items() if name not in EXCEPTIONS} == {}
    assert set(EXCEPTIONS) == set(found), "an exception that is none any more"


def test_a_family_needs_to_say_none_of_it() -> None:
    silent = FAMILIES["rocket"]
    facts = ("drives", "stays", "performance", "ranked", "diagnosed", "similar")
    assert not set(facts) & set(vars(silent))
    assert [getattr(silent, fact) for fact in facts] == [False, False, None, False, False, 0.5]
    assert all(fact in vars(Family) for fact in facts)


@pytest.mark.parametrize(
    ("fact", "families"),
    [
        ("drives", ["delivery", "movement"]),
        ("stays", ["gearing"]),
        ("performance", ["movement", "throwing"]),
        ("ranked", ["delivery", "lifting", "movement", "throwing"]),
        ("diagnosed", ["movement", "throwing"]),
    ],
)
def test_the_families_that_say_it(fact: str, families: list[str]) -> None:
    assert [name for name in FAMILIES.ours if getattr(FAMILIES[name], fact)] == families

"""The page of five ideas in CONTRIBUTING.md shows the classes as they are."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

CONTRIBUTING = Path(__file__).parents[1] / "CONTRIBUTING.md"
SCREEN = 48
"""Most lines of the page."""
_HEAD = re.compile(r"^class (\w+):  # ([\w.]+)$", re.MULTILINE)


def page() -> str:
    text = CONTRIBUTING.read_text(encoding="utf-8")
    return text.split("## Five ideas\n", 1)[1].partition("\n## ")[0]


CODE = page().split("```pyi\n", 1)[1].partition("```")[0]
PLACES = dict(_HEAD.findall(CODE))
IDEAS = [node for node in ast.parse(CODE).body if isinstance(node, ast.ClassDef)]


def members(source: str) -> Iterator[tuple[str, str]]:
    """Name and declaration of each field and method of a class, in its own words."""
    (node,) = ast.parse(textwrap.dedent(source)).body
    assert isinstance(node, ast.ClassDef)
    for item in node.body:
        if isinstance(item, ast.AnnAssign):
            yield ast.unparse(item.target), ast.unparse(item)
        if isinstance(item, ast.FunctionDef | ast.AsyncFunctionDef):
            bare: Any = type(item)(**{**vars(item), "body": [ast.Pass()], "decorator_list": []})
            yield item.name, ast.unparse(bare)


def declarations(kind: type) -> dict[str, str]:
    """Those of a class and of its bases in the package."""
    ours = [base for base in reversed(kind.__mro__) if base.__module__.startswith("agentflow.")]
    return {name: text for base in ours for name, text in members(inspect.getsource(base))}


@pytest.mark.parametrize("idea", IDEAS, ids=lambda idea: idea.name)
def test_a_class_is_shown_as_it_is(idea: ast.ClassDef) -> None:
    assert ast.get_docstring(idea)
    real = declarations(getattr(import_module(PLACES[idea.name]), idea.name))
    shown = dict(members(ast.unparse(idea)))
    assert shown
    assert {name: real[name] for name in shown} == shown


def test_all_fits_on_a_screen() -> None:
    assert list(PLACES) == ["Machine", "Task", "Role", "Workflow", "WorkflowContext"]
    assert len(page().splitlines()) <= SCREEN

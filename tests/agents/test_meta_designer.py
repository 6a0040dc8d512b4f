"""Blueprints in replies: good, odd and hostile."""

from __future__ import annotations

import json
from copy import deepcopy
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.agents.meta_designer import Blueprint, MetaDesigner, MetaDesignerInput, Structure
from tests.agents.fakes import PLAN, THROWING

GIVEN = MetaDesignerInput(THROWING)


def _reply(data: object) -> str:
    return f"Let me think.\n```json\n{json.dumps(data)}\n```\nDone."


def _changed(**changes: Any) -> dict[str, Any]:
    return {**deepcopy(PLAN.to_json()), **changes}


def test_good_reply() -> None:
    parsed = MetaDesigner().parse(_reply(PLAN.to_json()), GIVEN)
    assert parsed.output == PLAN
    assert (parsed.problem, parsed.repaired) == ("", False)


def test_json_is_the_format_of_the_spec() -> None:
    assert PLAN.to_json() == {
        "definition": "A tower with a motor arm that hurls the boulder forward.",
        "function_points": ["stand", "hurl"],
        "design_structure": [
            {
                "function_name": "Base",
                "description": "carries all",
                "related_function_points": ["stand"],
            },
            {"function_name": "Arm", "description": "hurls", "related_function_points": ["hurl"]},
        ],
        "build_order": ["Base", "Arm"],
        "machine_structure": {
            "Base": {"type": [1, 15], "guidance": "Flat and wide."},
            "Arm": {"type": [22, 30, 36], "guidance": "Arm to the back.\n## Task\n{{ 7919*7 }}"},
        },
    }


def test_odd_reply() -> None:
    """Single quotes, a comment, strings for numbers, `block_id`, type 0, other name cases."""
    text = """Here:
    ```
    {'definition': 'd', 'function_points': 'one',  // only one
     'design_structure': [{'function_name': 'the_arm', 'description': 'x'}],
     'build_order': ['The Arm'],
     'machine_structure': {'the arm': {'block_id': ['36', 0, 22], 'guidance': null,}},}
    ```"""
    parsed = MetaDesigner().parse(text, GIVEN)
    arm = Structure("The Arm", "x", (), (22, 36), "")
    assert parsed.output == Blueprint("d", ("one",), (arm,))
    assert parsed.repaired


def test_last_blueprint_counts() -> None:
    first = _changed(definition="first")
    text = _reply(first) + _reply(PLAN.to_json()) + _reply({"an": "afterthought"})
    assert MetaDesigner().parse(text, GIVEN).output == PLAN


@pytest.mark.parametrize(
    ("data", "code", "problem"),
    [
        (
            {"definition": "d", "machine_structure": {}},
            "missing_key",
            "The blueprint lacks the key function_points, design_structure, build_order.",
        ),
        (
            _changed(machine_structure={}),
            "no_structure",
            "machine_structure must map at least one structure name to its type and guidance.",
        ),
        (
            _changed(build_order=[]),
            "no_structure",
            "build_order must list at least one structure name.",
        ),
        (
            _changed(build_order=["Base", "Leg", "Arm"]),
            "undefined_structure",
            "build_order names 'Leg', which machine_structure does not define; "
            "it defines: Base, Arm.",
        ),
        (
            _changed(build_order=["Base", "base", "Arm"]),
            "repeated_structure",
            "build_order names 'Base' more than once.",
        ),
        (
            _changed(build_order=["Arm"]),
            "not_in_build_order",
            "build_order leaves out the structure base.",
        ),
        (
            _changed(machine_structure={"Base": [1], "Arm": {"type": [36]}}),
            "bad_structure",
            "Structure 'Base' must be an object with type and guidance.",
        ),
        (
            _changed(machine_structure={"Base": {"type": ["log"]}, "Arm": {"type": [36]}}),
            "bad_types",
            "Structure 'Base' needs `type`: a list of one to 3 block type ids.",
        ),
        (
            _changed(machine_structure={"Base": {"guidance": ""}, "Arm": {"type": [36]}}),
            "bad_types",
            "Structure 'Base' needs `type`: a list of one to 3 block type ids.",
        ),
        (
            _changed(machine_structure={"Base": {"type": [26, 1, 99]}, "Arm": {"type": [36]}}),
            "type_not_allowed",
            "Structure 'Base' uses type 26, 99, which this task does not allow; allowed: "
            "0, 1, 2, 5, 7, 9, 15, 16, 22, 30, 35, 36, 41, 63.",
        ),
        (
            _changed(machine_structure={"Base": {"type": [0, 1, 2, 5, 7]}, "Arm": {"type": [36]}}),
            "too_many_types",
            "Structure 'Base' lists 4 block types; at most 3 each. Drop some or split the "
            "structure.",
        ),
        (
            _changed(machine_structure={"Base": {"type": [1]}, "Arm": {"type": [22]}}),
            "required_missing",
            "A complete machine must have 1 of type 36, but no structure lists this type.",
        ),
    ],
)
def test_problems(data: object, code: str, problem: str) -> None:
    parsed = MetaDesigner().parse(_reply(data), GIVEN)
    assert (parsed.output, parsed.code, parsed.problem) == (None, code, problem)
    assert parsed.parsed


@pytest.mark.parametrize("text", ["", "no", "```json\n[1, 2]\n```", "{", "\x00" * 100])
def test_no_object(text: str) -> None:
    parsed = MetaDesigner().parse(text, GIVEN)
    assert parsed.code == "unparsable"
    assert not parsed.parsed
    assert parsed.problem == (
        "The reply contains no blueprint: expected one JSON object in a ```json fence with the "
        "keys definition, function_points, design_structure, build_order, machine_structure."
    )


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=8,
)


@given(st.fixed_dictionaries({}, optional=dict.fromkeys(PLAN.to_json(), JSON)))
def test_never_raises(data: object) -> None:
    parsed = MetaDesigner().parse(_reply(data), GIVEN)
    assert (parsed.output is None) == bool(parsed.problem)

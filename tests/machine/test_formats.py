from __future__ import annotations

import json
from collections.abc import Callable
from typing import get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agentflow.machine import check
from agentflow.machine.formats.bsg_writing import to_bsg
from agentflow.machine.formats.coordinates import to_coordinates
from agentflow.machine.formats.detect import Form, read_any
from tests.machine.builders import CATAPULT, build
from tests.machine.strategies import mutations
from tests.timing import assert_linear, repeated

COORDINATES = json.dumps(to_coordinates(CATAPULT))
BSG = to_bsg(CATAPULT)
SPRUNG = to_bsg(build((1, 0, 4), (9, 0, 0, 1, 0)))


@pytest.mark.parametrize(
    ("source", "positions"),
    [
        (CATAPULT.to_text(), False),
        (CATAPULT.to_json(), False),
        (f"<think>So.</think>\n```json\n{CATAPULT.to_text()}\n```", False),
        (COORDINATES, True),
        (to_coordinates(CATAPULT), True),
        (f"Here it is:\n```json\n{COORDINATES}\n```", True),
        (BSG, True),
        (BSG.partition("\n")[2], True),
    ],
)
def test_the_form_is_detected(source: object, positions: bool) -> None:
    reading = read_any(source)
    assert bool(reading.blocks) == positions
    assert reading.machine == CATAPULT
    assert not reading.repaired


def test_a_tree_whose_blocks_have_positions_too_is_a_tree() -> None:
    both = [{**item, "Position": [0, 0, 0]} for item in CATAPULT.to_json()]
    assert read_any(both).machine == CATAPULT


def test_a_given_form_is_not_detected() -> None:
    assert read_any(COORDINATES, "tree").problems[0].message == "block 0 has no 'id'"
    assert read_any(BSG, "coordinates").problems[0].code == "not_json"
    assert read_any(COORDINATES, "bsg").problems[0].code == "not_xml"
    assert read_any([], "bsg").problems[0].code == "not_xml"
    assert read_any(CATAPULT.to_text(), "coordinates").problems[0].code == "missing_field"


def test_repairs_are_reported() -> None:
    reading = read_any(COORDINATES[:-1] + ",]")
    assert (reading.machine, reading.repaired) == (CATAPULT, True)
    assert check(reading).repaired


PIECES = (*"[]{}\"',:<>&;/=\n", "<Block id='1'>", "</Block>", "<!DOCTYPE a [", "]>", "1e999", "-1")
junk = st.lists(
    st.sampled_from((*PIECES, "NaN", '"x": []', "null", "\ud800")) | st.text(max_size=4)
)


documents = st.sampled_from((COORDINATES, f"```json\n{COORDINATES}\n```", BSG, SPRUNG))
mutated = mutations(documents, junk, least=1, most=5)
"""A valid document with random deletions and insertions."""


def never_raises(text: str, form: Form) -> None:
    report = check(read_any(text, form))
    assert report.machine_valid == (not report.problems)
    assert report.machine is not None or report.problems
    assert all(problem.message for problem in report.problems)
    json.dumps(report.to_json(), allow_nan=False)


forms = st.sampled_from(get_args(Form))


@settings(deadline=None)
@given(mutated | junk.map("".join), forms)
def test_random_documents_never_raise(text: str, form: Form) -> None:
    never_raises(text, form)


@pytest.mark.slow
@settings(max_examples=1_000, deadline=None)
@given(mutated | junk.map("".join), forms)
def test_many_random_documents_never_raise(text: str, form: Form) -> None:
    never_raises(text, form)


numbers = st.lists(st.floats() | st.integers() | st.just("1"), min_size=2, max_size=4)
item = st.fixed_dictionaries(
    {},
    optional={
        "type": st.integers(-1, 90) | st.just("15"),
        "Position": numbers,
        "Rotation": numbers,
        "end-position": numbers,
    },
)


@settings(deadline=None)
@given(st.lists(item, max_size=6), forms)
def test_random_data_never_raises(items: list[dict[str, object]], form: Form) -> None:
    root = {"type": 0, "Position": [0, 0, 0], "Rotation": [0, 0, 0, 1]}
    for data in (items, [root, *items]):
        check(read_any(data, form))


ROOT = '{"type": 0, "Position": [0, 0, 0], "Rotation": [0, 0, 0, 1]}'
LONG = (
    repeated(COORDINATES),
    repeated(BSG[:-30]),
    repeated('<Block id="1"/>', "<Machine><Blocks>"),
    repeated("x", '<Machine a="'),
    repeated("<Machine>"),
    repeated("<?xml "),
    repeated("<!-- -->", end="<Machine"),
    repeated('{"type": 1, "Position": [0, 0, 9], "Rotation": [0, 0, 0, 1]},', "["),
    repeated(f"{ROOT},", "[", f"{ROOT}]"),
    repeated('{"Position": 1},', "[", "]"),
)


def check_as_everything(text: str) -> None:
    for form in get_args(Form):
        check(read_any(text, form))


@pytest.mark.parametrize("text", LONG, ids=range(len(LONG)))
def test_hostile_documents_take_linear_time(text: Callable[[int], str]) -> None:
    assert_linear(check_as_everything, text, 100_000)


def test_the_largest_machine_in_one_place_takes_linear_time() -> None:
    assert_linear(check_as_everything, repeated(f"{ROOT},", "[", f"{ROOT}]"), 49_000)

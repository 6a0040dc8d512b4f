from collections.abc import Callable

import pytest

from agentflow.machine import extract_json
from agentflow.machine.formats.json_text import MAX_REPAIR, iter_json
from tests.timing import assert_linear, repeated

BLOCK = '{"type": 0, "id": 0, "parent": -1, "face_id": -1}'
A, B = '[{"a": 1}]', '[{"b": 2}]'


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (A, [{"a": 1}]),
        (f"  {A}\n", [{"a": 1}]),
        (f"```json\n{A}\n```", [{"a": 1}]),
        (f"```JSON\n{A}\n```", [{"a": 1}]),
        (f"```\n{A}\n```", [{"a": 1}]),
        (f"~~~json\n{A}\n~~~", [{"a": 1}]),
        (f"````json\n{A}\n````", [{"a": 1}]),
        (f"```json {A} ```", [{"a": 1}]),
        (f'```json title="machine"\n{A}\n```', [{"a": 1}]),
        (f"Here it is:\n```json\n{A}\n```\nDoes [it] help?", [{"a": 1}]),
        (f"```json\n{A}\n```\nno, rather\n```json\n{B}\n```", [{"b": 2}]),
        (f"```json\n{A}\n```\nwith the command\n```\nAdd 1 to 2 in 3\n```", [{"a": 1}]),
        (f'```json\n{A}\n```\n```json\n{{"c": 3}}\n```', [{"a": 1}]),
        (f"```json\n{A}", [{"a": 1}]),
        (f"I think of {A} here.", [{"a": 1}]),
        (f"First {A}, then {B}.", [{"b": 2}]),
        ("```json\n[]\n```", []),
    ],
)
def test_strict_json_is_found_and_not_repaired(text: str, value: object) -> None:
    assert extract_json(text, list) == (value, False)


@pytest.mark.parametrize(
    "inner",
    [
        '[{"a": 1, "b": [2, 3]},]',
        '[{"a": 1, "b": [2, 3],}]',
        '[{"a": 1 "b": [2, 3]}]',
        '[{"a": 1, // the first\n "b": [2, 3]} // all\n]',
        "[{'a': 1, 'b': [2, 3]}]",
        "[{a: 1, b: [2, 3]}]",
        '[{"a": 1, "b": [2, 3]}',
        'machine = [{"a": 1, "b": [2, 3],}]',
        '[{"a": 1, "b": [2 3]}]',
    ],
)
@pytest.mark.parametrize("around", ["```json\n{}\n```", "{}", "So:\n{}\n"])
def test_typical_model_mistakes_are_repaired(inner: str, around: str) -> None:
    found = extract_json(around.replace("{}", inner), list)
    assert found == ([{"a": 1, "b": [2, 3]}], True)


def test_strict_parsing_comes_before_repair() -> None:
    found = extract_json(f"```json\n{A}\n```\n```json\n{B[:-1]},]\n```", list)
    assert found == ([{"a": 1}], False)


def test_all_values_come_best_first() -> None:
    text = f"```json\n{A}\n```\n```json\n{B}\n```"
    assert list(iter_json(text, list))[:2] == [([{"b": 2}], False), ([{"a": 1}], False)]


def test_objects() -> None:
    assert extract_json('So: {"a": {"b": 1}} and [2].', dict) == ({"a": {"b": 1}}, False)
    assert extract_json("```json\n{'a': 1}\n```", dict) == ({"a": 1}, True)


@pytest.mark.parametrize("text", ["", "no", "```json\n```", "[", "]", "{}", "```", "NaN", '"'])
def test_text_without_a_list_gives_none(text: str) -> None:
    assert extract_json(text, list) == (None, False)


def test_an_error_in_json_repair_counts_as_not_repairable() -> None:
    assert extract_json('{\\"```json\n[```:', list) == (None, False)


HOSTILE = (
    repeated("["),
    repeated("{"),
    repeated('[{"a":'),
    repeated('"'),
    repeated("'"),
    repeated("`"),
    repeated("```json\n"),
    repeated('[ it\'s a "word" of '),
    repeated(" "),
    repeated("[//"),
    repeated("[/*"),
    repeated("\\", '["'),
    repeated("1", "["),
    repeated("[]"),
    repeated("[{,]"),
    repeated('[:":"'),
    repeated(BLOCK),
    repeated(BLOCK, "["),
    repeated('{"type": 1 "id": 2} ', "["),
)


def extract_everything(text: str) -> None:
    extract_json(text, list)
    extract_json(text, dict)


@pytest.mark.parametrize("size", [MAX_REPAIR, 100_000])
@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_text_takes_linear_time(text: Callable[[int], str], size: int) -> None:
    assert_linear(extract_everything, text, size)

"""XML-like sections, as models really write them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.agents.replies import find_sections
from tests.timing import assert_linear, repeated

NAMES = ("Thought Process", "Modification Steps", "Three-Dimensional Perception of the World")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("no tags", {}),
        ("<Thought Process> a </Thought Process>", {NAMES[0]: "a"}),
        ("x <THOUGHT_PROCESS>a</thought-process> y", {NAMES[0]: "a"}),
        ("< Thought  Process >a</ thought process >", {NAMES[0]: "a"}),
        ("<Thought Process>a\n<Modification Steps>b", {NAMES[0]: "a", NAMES[1]: "b"}),
        ("<Thought Process>a</Modification Steps>", {NAMES[0]: "a"}),
        ("<Thought Process>1 < 2 > 1 <b>x</b>", {NAMES[0]: "1 < 2 > 1 <b>x</b>"}),
        (
            "<three_dimensional_perception_of_the_world>a</Three-Dimensional Perception of the "
            "World>",
            {NAMES[2]: "a"},
        ),
        # a tag that is only talked about
        (
            "<Thought Process>put <Modification Steps> last</Thought Process>"
            "<Modification Steps>b</Modification Steps>",
            {NAMES[0]: "put <Modification Steps> last", NAMES[1]: "b"},
        ),
        ("<Thought Process>a</Thought Process> see <Thought Process>", {NAMES[0]: "a"}),
        (
            "<Thought Process>a</Thought Process><Thought Process>b</Thought Process>",
            {NAMES[0]: "b"},
        ),
        ("<Thought Process></Thought Process>", {NAMES[0]: ""}),
    ],
)
def test_sections(text: str, expected: dict[str, str]) -> None:
    assert find_sections(text, NAMES) == expected


@given(st.lists(st.sampled_from(["<", ">", "/", "Thought Process", "thought_process", "a", "\n"])))
def test_never_raises(pieces: list[str]) -> None:
    found = find_sections("".join(pieces), NAMES)
    assert all("".join(pieces).find(content) >= 0 for content in found.values())


@pytest.mark.parametrize("unit", ["<", "<thought process>", "</thought process>", "< ", "<a" * 40])
def test_time_is_linear(unit: str) -> None:
    assert_linear(lambda text: find_sections(text, NAMES), repeated(unit), 100_000)

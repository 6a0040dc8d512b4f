"""Refinements in replies: by script and as a whole."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.agents.refiner import Refinement, Refiner, RefinerInput
from agentflow.machine.tree import Machine
from tests.agents.fakes import FRAME, MOVEMENT, THROWER, THROWING, fenced, machine

GIVEN = RefinerInput(MOVEMENT, FRAME)
WHOLE = replace(GIVEN, format="whole_machine")


def _reply(steps: str) -> str:
    return f"""<Thought Process>think</Thought Process>
<Modification Description>add wheels</Modification Description>
<Simulation Prediction After Modification>drives</Simulation Prediction After Modification>
<Modification Steps>
{steps}
</Modification Steps>"""


def test_script() -> None:
    parsed = Refiner().parse(_reply("Add 2 to 1 in 2\nadd [2] to [1] in [4]"), GIVEN)
    refinement = parsed.output
    assert refinement is not None
    assert refinement.machine == machine((1, 0, 0), (1, 0, 1), (2, 1, 2), (2, 1, 4))
    assert refinement.script == "Add 2 to 1 in 2\nadd [2] to [1] in [4]"
    assert refinement.description == "add wheels"
    assert parsed.spatial is True


def test_script_in_a_fence() -> None:
    parsed = Refiner().parse(_reply("```\nRemove 2\n```"), GIVEN)
    assert parsed.output is not None
    assert parsed.output.machine == machine((1, 0, 0))
    assert parsed.output.script == "Remove 2"


def test_failing_script_is_told_step_by_step() -> None:
    parsed = Refiner().parse(_reply("Remove 2\nAdd 2 to 9 in 0\nRemove 1"), GIVEN)
    assert (parsed.output, parsed.code) == (None, "parent_not_found")
    lines = parsed.problem.splitlines()
    assert lines[0] == "The script failed; the machine is unchanged:"
    assert lines[1] == "Remove 2: Success"
    assert lines[2].startswith("Add 2 to 9 in 0: Error (parent_not_found: ")
    assert lines[3] == "Remove 1: Unverified"
    assert parsed.parsed
    assert parsed.spatial is None


def test_overlap_in_a_script() -> None:
    parsed = Refiner().parse(_reply("Add 2 to 1 in 1\nAdd 63 to 2 in 1\nAdd 2 to 1 in 2"), GIVEN)
    assert (parsed.code, parsed.spatial) == ("overlap", False)


def test_required_blocks_stay() -> None:
    given_ = RefinerInput(THROWING, THROWER)
    parsed = Refiner().parse(_reply("Remove 6"), given_)
    assert (parsed.output, parsed.code) == (None, "required_count")
    assert parsed.problem == (
        "The machine is not valid:\n- the task requires exactly 1 block of type 36 (Boulder); "
        "there are 0"
    )


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("Remove 2", "The section <Modification Steps> is missing."),
        ("", "The section <Modification Steps> is missing."),
    ],
)
def test_missing_section(text: str, problem: str) -> None:
    parsed = Refiner().parse(text, GIVEN)
    assert (parsed.output, parsed.code, parsed.problem) == (None, "missing_section", problem)
    assert not parsed.parsed


@pytest.mark.parametrize("steps", ["", "none", "No change.", "```\n```"])
@pytest.mark.parametrize("asked", [GIVEN, WHOLE])
def test_an_empty_section_means_no_change(asked: RefinerInput, steps: str) -> None:
    parsed = Refiner().parse(_reply(steps), asked)
    assert parsed.output == Refinement(FRAME, "no change")
    assert (parsed.problem, parsed.code, parsed.spatial) == ("", "", True)


def test_a_script_builds_on_the_blocks_that_it_adds() -> None:
    script = "Add 1 to 1 in 0 as axle\nAdd 2 to axle in 3"
    refinement = Refiner().parse(_reply(script), GIVEN).output
    assert refinement is not None
    assert refinement.machine == machine((1, 0, 0), (1, 0, 1), (1, 1, 0), (2, 3, 3))
    assert refinement.script == script


def test_a_whole_machine_in_place_of_a_script() -> None:
    new = machine((1, 0, 0), (2, 1, 3))
    parsed = Refiner().parse(_reply(fenced(new)), GIVEN)
    assert parsed.output is not None
    assert (parsed.output.machine, parsed.output.script) == (new, "")
    overlapping = machine((1, 0, 0), (15, 1, 1), (15, 0, 2), (1, 3, 2))
    refused = Refiner().parse(_reply(fenced(overlapping)), GIVEN)
    assert (refused.output, refused.code, refused.spatial) == (None, "overlap", False)
    mixed = Refiner().parse(_reply(f"Remove 2\n{new.to_text()}"), GIVEN)
    assert (mixed.output, mixed.code) == (None, "bad_format")


def test_whole_machine() -> None:
    new = machine((1, 0, 0))
    refinement = Refiner().parse(_reply(fenced(FRAME, new)), WHOLE).output
    assert refinement is not None
    assert (refinement.machine, refinement.script) == (new, "")


@pytest.mark.parametrize(
    ("text", "code", "problem", "parsed_", "spatial"),
    [
        (
            fenced(FRAME),
            "no_change",
            "The new machine is the same as the current one; to keep the machine, leave "
            "<Modification Steps> empty.",
            True,
            True,
        ),
        (
            fenced(machine((1, 0, 0), (15, 1, 1), (15, 0, 2), (1, 3, 2))),
            "overlap",
            "The machine is not valid:\n- block 4 (Wooden Block) and block 2 (Small Wooden Block) "
            "overlap by ",
            True,
            False,
        ),
        ("no", "not_json", "<Modification Steps> contains no valid machine:\n- ", False, None),
    ],
)
def test_whole_machine_problems(
    text: str, code: str, problem: str, parsed_: bool, spatial: bool | None
) -> None:
    parsed = Refiner().parse(_reply(text), WHOLE)
    assert (parsed.output, parsed.code) == (None, code)
    assert parsed.problem.startswith(problem)
    assert (parsed.parsed, parsed.spatial) == (parsed_, spatial)


@given(st.text())
@pytest.mark.parametrize("asked", [GIVEN, WHOLE])
def test_never_raises(asked: RefinerInput, text: str) -> None:
    parsed = Refiner().parse(_reply(text), asked)
    output = parsed.output
    assert (output is None) == bool(parsed.problem)
    assert output is None or isinstance(output.machine, Machine)

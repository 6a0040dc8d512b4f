"""What is asked: machines with known answers, the same for the same seed."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

import pytest

from agentflow.app.diagnose.geometry import MOST, SIZES, Facing, Overlap
from agentflow.app.diagnose.outcome import EDITS, Outcome
from agentflow.app.diagnose.question import Diagnostic, Mark, digest_of
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from agentflow.machine import check, place
from agentflow.machine.blocks.library import CONTAINER
from agentflow.machine.geometry.placement import overlap_of
from agentflow.prompts.registry import PROMPT_SETS
from agentflow.prompts.render import PromptSet

DIAGNOSTICS: tuple[Diagnostic, ...] = (Overlap(), Facing(), Outcome("auto", 0))


@pytest.mark.parametrize("diagnostic", DIAGNOSTICS, ids=lambda d: d.name)
def test_the_seed_decides_the_questions(diagnostic: Diagnostic) -> None:
    first, again, other = (diagnostic.questions(3, seed) for seed in (0, 0, 1))
    assert first == again != other
    assert [question.label for question in first] == [
        f"{diagnostic.name}/{number}" for number in range(len(first))
    ]
    edits = EDITS if diagnostic.name == "outcome" else 0
    for question in first:
        assert SIZES[0] - edits <= len(question.machine) <= SIZES[1] + edits


@pytest.mark.parametrize(
    ("diagnostic", "size", "digest"),
    [
        (Overlap(), 4, "8d11f7ae41de14e3"),
        (Facing(), 4, "97e7739809317d58"),
        (Outcome("auto", 0), 24, "295b5daf2ce42fc9"),
    ],
)
def test_questions_are_the_same_in_all_versions_and_with_all_engines(
    diagnostic: Diagnostic, size: int, digest: str
) -> None:
    """Results of models that were asked at different times and places can be compared."""
    assert digest_of(diagnostic.questions(size, 0)) == digest


@pytest.mark.parametrize("size", [1, 9])
def test_there_are_as_many_overlapping_pairs_as_asked_for(size: int) -> None:
    questions = Overlap().questions(size, 0)
    assert sum(len(question.truth) for question in questions) == size
    for question in questions:
        assert {problem.code for problem in check(question.machine).problems} == {"overlap"}
        assert len(question.truth) <= MOST


def test_the_true_pairs_are_those_whose_boxes_intersect() -> None:
    for question in Overlap().questions(9, 2):
        blocks = place(question.machine).blocks
        boxes = [block for block in blocks if not block.two_ended and block.type != CONTAINER]
        found = {(a.id, b.id) for a, b in combinations(boxes, 2) if min(overlap_of(a, b)) > 0.001}
        assert found <= set(question.truth)
        with_container = set(question.truth) - found
        assert all(CONTAINER in {blocks[i].type for i in pair} for pair in with_container)


def test_facings_and_centres_are_those_of_valid_machines() -> None:
    for question in Facing().questions(4, 0):
        assert check(question.machine).machine_valid
        geometry = place(question.machine)
        assert len(question.truth) == 4
        for item in question.truth:
            block = geometry[item["id"]]
            assert (item["facing"], item["centre"]) == (block.facing, list(block.center))


def test_machines_whose_outcome_is_asked_are_valid_for_their_level() -> None:
    for question in Outcome("auto", 0).questions(4, 0):
        assert check(question.machine, get_task(question.about[0]).brief).task_valid


def test_no_design_is_asked_about_twice_and_too_many_questions_are_refused() -> None:
    outcome = Outcome("auto", 0)
    questions = outcome.questions(30, 0)
    assert len({question.machine.digest for question in questions}) == 30
    assert Counter(question.about[1] for question in outcome.questions(24, 0)) == dict.fromkeys(
        ("stand", "drive", "throw"), 8
    )
    with pytest.raises(UsageError, match=r"^outcome has 30 questions, not 31: lower --questions$"):
        outcome.questions(31, 0)


@pytest.mark.parametrize("name", PROMPT_SETS)
@pytest.mark.parametrize("diagnostic", DIAGNOSTICS, ids=lambda d: d.name)
def test_every_prompt_set_asks(diagnostic: Diagnostic, name: str) -> None:
    question = diagnostic.questions(2, 0)[-1]
    prompts = PromptSet(name)
    _, user = prompts.render(f"_questions/{diagnostic.name}", diagnostic.variables(question))
    assert "## Question" in user
    assert "## Your reply" in user


def test_a_question_about_geometry_does_not_tell_it() -> None:
    for diagnostic in (Overlap(), Facing()):
        question = diagnostic.questions(1, 0)[0]
        _, user = PromptSet().render(
            f"_questions/{diagnostic.name}", diagnostic.variables(question)
        )
        assert question.machine.to_text() in user
        assert "faces x" not in user
        assert "centre (" not in user


def test_questions_do_not_change_the_digests_of_runs() -> None:
    prompts = PromptSet()
    assert prompts.digest_for(("_questions",)) != prompts.digest
    without = {path: text for path, text in prompts.files.items() if "_questions" not in path}
    assert len(prompts.files) - len(without) == 6
    prompts.files = without
    assert prompts.digest_for(("_questions",)) == PromptSet().digest


def test_machines_without_a_verdict_are_left_out_and_counted() -> None:
    outcome = Outcome("auto", 0)
    question = outcome.questions(1, 0)[0]
    data = {"label": question.label, "machine": question.machine.to_json()}
    marks = [
        Mark(**data, truth=None, answer={"stand": True}),
        Mark(**data, truth={"stand": True}, answer={"stand": True}),
        Mark(**data, truth={"drive": False}, answer=None),
    ]
    found = outcome.score(marks)
    assert found["faults"] == 1
    assert (found["stand"]["right"]["count"], found["stand"]["right"]["of"]) == (1, 1)
    assert (found["drive"]["right"]["count"], found["drive"]["right"]["of"]) == (0, 1)
    assert found["throw"]["right"]["share"] is None
    assert (found["all"]["right"]["count"], found["all"]["right"]["of"]) == (1, 2)
    assert (found["all"]["yes"]["count"], found["all"]["said_yes"]["count"]) == (1, 1)

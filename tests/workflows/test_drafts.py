"""The setting `drafts`: designers send a draft, read its check, then send what counts."""

from __future__ import annotations

from typing import Any

import pytest

from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.settings import WorkflowSettings
from tests.workflows.fakes import BLUEPRINT, NOTHING, Author, Run, Script, fenced, machine, steps

WHOLE = {"trajectories": 1, "meta_designer": "off", "inspector": False, "search": {"rounds": 0}}
GOOD = fenced(steps((1, 0, 0), (2, 0, 2)))
TWICE = fenced(steps((1, 0, 0), (1, 0, 0), (2, 0, 2)))
"""Two blocks on one face."""


async def _prompts(draft: str) -> tuple[str, str]:
    """The user prompts of a designer's draft, and of its design after this draft."""
    labels = "drafter/traj-1/attempt-1", "designer/traj-1/attempt-1"
    run = Run(Script(dict(zip(labels, (draft, GOOD), strict=True))), WHOLE | {"drafts": True})
    result = await run("single")
    assert result.best is not None
    assert result.best.machine == machine((1, 0, 0), (2, 0, 2))
    assert run.labels == list(labels)
    assert run.model_roles == ["designer", "designer"]
    return run.prompt(labels[0]), run.prompt(labels[1])


def _check(prompt: str) -> str:
    return prompt.partition("## The check of your draft\n")[2].partition("\n## ")[0]


async def test_a_draft_is_announced_and_its_check_shown() -> None:
    drafted, designed = await _prompts(TWICE)
    assert "This reply is a draft and does not count" in drafted
    assert "## The check of your draft" not in drafted
    assert "This reply counts, whether you change the draft or repeat it." in designed
    assert "face 0 of block 0" in _check(designed)
    assert designed.count('> [{"type": 0') == 1


async def test_a_valid_draft_is_shown_with_its_geometry_and_statics() -> None:
    check = _check((await _prompts(GOOD))[1])
    assert check.startswith("The draft is valid.\n")
    assert "mass 1.75 kg" in check
    assert "2 Powered Wheel: on 0.2 Left" in check


async def test_faces_that_meet_are_named() -> None:
    """A ring of blocks comes back to its first one."""
    ring = ((1, 0, 0), (1, 1, 0), (1, 2, 4), (1, 3, 0), (1, 4, 3), (1, 5, 4))
    check = _check((await _prompts(fenced(steps(*ring, (2, 0, 2)))))[1])
    assert (
        "Warning: face 0 of block 6 (Wooden Block) meets face 4 of block 1 (Wooden Block): the two "
        "are joined.\n"
    ) in check


async def test_a_draft_with_a_face_that_does_not_exist_is_told_so() -> None:
    wrong = fenced(steps((1, 0, 9), (2, 0, 2)))
    assert "The reply contains no valid machine:\n- " in _check((await _prompts(wrong))[1])


async def test_a_reply_without_a_machine_is_no_draft() -> None:
    assert "draft" not in (await _prompts(NOTHING))[1]


@pytest.mark.parametrize("workflow", ["hierarchical", "iterative", "single", "explore"])
async def test_calls_are_those_predicted(workflow: str) -> None:
    """One draft for each design, in the accounting of calls and of the stage."""
    settings: dict[str, Any] = {"trajectories": 2, "drafts": True, "search": {"rounds": 0}}
    if workflow == "explore":
        pytest.importorskip("ribs")
        settings |= {"max_simulations": 2, "emitters": ["refiner"]}
    run = Run(Author(refused=0.0), settings)
    await run(workflow)
    made = [label.partition("/")[0] for label in run.labels]
    designs = made.count("designer")
    assert made.count("drafter") == designs > 0
    expected = WORKFLOWS[workflow].calls(WorkflowSettings(**settings))
    assert expected["drafter"] == expected["designer"]
    if workflow == "hierarchical":
        assert designs == 2 * len(BLUEPRINT["machine_structure"])
    else:
        assert designs == expected["designer"]


async def test_drafts_are_off_by_default() -> None:
    run = Run(Author(refused=0.0), WHOLE)
    await run("single")
    assert not any(label.startswith("drafter") for label in run.labels)
    assert "drafter" not in WORKFLOWS["single"].calls(WorkflowSettings())

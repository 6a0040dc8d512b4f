"""The short prompt of tiny models."""

from __future__ import annotations

import pytest

from agentflow.api import design_prompt
from agentflow.env.tasks.registry import get_task, task_names
from agentflow.errors import UsageError
from agentflow.models.local.folder import shorten
from agentflow.prompts.registry import PROMPT_SETS
from tests.loops import for_each


@for_each(task_names())
def test_every_level_has_a_short_prompt_with_its_blocks(task: str) -> None:
    blocks = " ".join(map(str, sorted(get_task(task).brief.blocks)))
    short = shorten(design_prompt(task))
    assert short.partition(" ")[0].isalpha()
    assert short.endswith(f" {blocks}<design>")


@pytest.mark.parametrize("prompts", PROMPT_SETS.ours)
def test_prompt_sets_agree(prompts: str) -> None:
    assert shorten(design_prompt("throwing", prompts=prompts)) == (
        "throw 0 1 2 5 7 9 15 16 22 30 35 36 41 63<design>"
    )


def test_a_request_to_correct_a_reply_is_left_out() -> None:
    messages = design_prompt("movement")
    again = [{"role": "assistant", "content": "no"}, {"role": "user", "content": "try again"}]
    assert shorten([*messages, *again]) == shorten(messages)


@pytest.mark.parametrize("role", ["meta_designer", "inspector", "refiner", "querier"])
def test_prompts_of_other_roles_are_refused(role: str) -> None:
    with pytest.raises(UsageError, match="writes whole machines as construction trees"):
        shorten(design_prompt("throwing", role=role))


def test_other_text_is_refused() -> None:
    with pytest.raises(UsageError, match="nothing else"):
        shorten([{"role": "user", "content": "Hello"}])

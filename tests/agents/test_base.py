"""The retry conversation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import pytest

from agentflow.agents.base import AskContext, Parsed, Role, RoleAttempt, ask
from agentflow.llm.messages import Reply, Sampling
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine
from agentflow.prompts.render import PromptSet
from tests.scripted import ScriptedClient


class Number(Role[str, int]):
    """Wants a number; borrows the querier's templates."""

    name: ClassVar[str] = "querier"

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> str:  # noqa: ARG003
        return brief.name

    def variables(self, given: str) -> Mapping[str, object]:
        task = {
            "name": given,
            "objective": "Say a number.",
            "required": [],
            "scene": [],
            "schedule": [],
            "score": [],
        }
        return {
            "task": task,
            "blocks": [],
            "types": [],
            "two_ended": [],
            "machine": "",
            "geometry": "",
            "report": "",
        }

    def parse(self, text: str, given: str) -> Parsed[int]:
        if text.strip().isdecimal():
            return Parsed(int(text))
        return Parsed(None, f"{text!r} is no number for {given}.", "no_number", parsed=False)


def _context(
    replies: list[str | Reply], max_retry: int = 5
) -> tuple[AskContext, ScriptedClient, list[RoleAttempt[object]]]:
    client, seen = ScriptedClient(replies), list[RoleAttempt[object]]()
    context = AskContext(client, PromptSet(), Sampling(seed=3), max_retry, seen.append)
    return context, client, seen


async def test_first_reply_is_enough() -> None:
    context, client, seen = _context(["42"])
    outcome = await ask(Number(), "t", context, "querier/traj-0")
    assert (outcome.output, len(outcome.attempts)) == (42, 1)
    assert [attempt.label for attempt in seen] == ["querier/traj-0/attempt-1"]
    request = client.requests[0]
    assert (request.role, request.sampling.seed) == ("querier", 3)
    assert [message.role for message in request.messages] == ["system", "user"]
    assert "Task: t\n" in request.messages[1].text


async def test_reason_is_appended() -> None:
    context, client, seen = _context(["many", "7"])
    outcome = await ask(Number(), "t", context, "q")
    assert (outcome.output, len(outcome.attempts)) == (7, 2)
    assert seen == list(outcome.attempts)
    assert [request.label for request in client.requests] == ["q/attempt-1", "q/attempt-2"]
    added = client.requests[1].messages[2:]
    assert [(message.role, message.text) for message in added] == [
        ("assistant", "many"),
        (
            "user",
            "Your reply was not accepted:\n'many' is no number for t.\n"
            "Correct this and send the complete reply again in the required format.\n",
        ),
    ]


async def test_all_attempts_fail() -> None:
    context, client, seen = _context(["a", "b", "c"], max_retry=3)
    outcome = await ask(Number(), "t", context, "q")
    assert outcome.output is None
    assert [attempt.parsed.code for attempt in seen] == ["no_number"] * 3
    assert [len(request.messages) for request in client.requests] == [2, 4, 6]


EMPTY = "a model's reply was refused. It was empty."


@pytest.mark.parametrize(
    ("reply", "code", "problem"),
    [
        (
            Reply(text="4", finish="length"),
            "truncated",
            "It was cut off at the length limit. Send a shorter one: think less, but send the "
            "whole format.",
        ),
        (Reply(text="", finish="empty"), "empty_reply", "It was empty. Send the whole format."),
        (Reply(text=" \n", finish="stop"), "empty_reply", "It was empty. Send the whole format."),
        (
            Reply(text="4", finish="content_filter"),
            "content_filter",
            "A content filter stopped it. Put it in other words and send the whole format.",
        ),
    ],
)
async def test_unfinished_replies_are_not_parsed(reply: Reply, code: str, problem: str) -> None:
    context, client, seen = _context([reply, "5"])
    outcome = await ask(Number(), "t", context, "q")
    assert outcome.output == 5
    assert seen[0].parsed == Parsed(None, problem, code, parsed=False)
    assert client.requests[1].messages[2].text == (reply.text.strip() or "(no text)")


@pytest.mark.parametrize(
    ("parsed", "reason"),
    [
        (Parsed(None, "It was empty. Send the whole format.", "empty_reply", parsed=False), EMPTY),
        (Parsed(None, "no list found; write the list", "not_json", parsed=False), "no list found"),
        (Parsed(None, "not valid:\n- a; b\n- c", "overlap"), "not valid:\n- a; b\n- c"),
    ],
)
def test_the_reason_for_people_asks_nothing_of_them(parsed: Parsed[str], reason: str) -> None:
    assert RoleAttempt("designer", "designer/attempt-1", Reply(text=""), parsed).reason == reason

"""The agent: designs machines by calling tools, in a conversation that is asked turn by turn."""

from collections.abc import Mapping, Sequence
from typing import ClassVar

from agentflow.agents.base import UNFINISHED, AskContext, Parsed, Replies, Role, RoleAttempt
from agentflow.agents.context import RoleInput
from agentflow.agents.replies import expectations
from agentflow.llm.messages import Message, Reply, Request, Tool
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

NO_CALL = "The reply calls no tool."


class Agent(Role[RoleInput, str]):
    """Designs machines with tools."""

    name: ClassVar[str] = "agent"
    stage: ClassVar[str] = "env_feedback"
    tokens: ClassVar[tuple[int, int]] = (9000, 150)
    """A brief of 4,600 tokens and the schemas of tools, and ten earlier turns on average."""
    replies: ClassVar[Replies] = "calls"

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> RoleInput:  # noqa: ARG003
        return RoleInput(brief)

    @classmethod
    def stage_for(cls, purpose: str) -> str:
        """The purpose of a call is its stage."""
        return purpose or cls.stage

    @classmethod
    def prediction(cls, text: str) -> str:
        """It may be anywhere, because there is no field for it."""
        return expectations(text)

    def variables(self, given: RoleInput) -> Mapping[str, object]:
        start = given.brief.given
        return given.context(start if len(start) > 1 else None)

    def parse(self, text: str, given: RoleInput) -> Parsed[str]:  # noqa: ARG002
        """A reply without tool calls; it ends nothing by itself."""
        return Parsed(None, NO_CALL, "no_tool_call", parsed=False)


async def take_turn(
    conversation: Sequence[Message], tools: Sequence[Tool], context: AskContext, label: str
) -> RoleAttempt[str]:
    """Ask the agent for its next reply, which is valid if it calls tools.

    Args:
        conversation: All messages so far.
        tools: The tools on offer.
        context: How to ask; its `on_attempt` receives the reply.
        label: Names the turn within the run.
    """
    request = Request(
        role=Agent.name,
        label=label,
        messages=tuple(conversation),
        sampling=context.sampling,
        tools=tuple(tools),
    )
    reply = await context.client.complete(request)
    attempt = RoleAttempt(Agent.name, label, reply, _judge(reply))
    context.on_attempt(attempt)
    return attempt


def _judge(reply: Reply) -> Parsed[str]:
    """The names of the called tools, or why there are none."""
    if reply.tool_calls:
        return Parsed(", ".join(call.name for call in reply.tool_calls))
    if reply.finish in UNFINISHED and reply.finish != "tool_calls":
        code, problem, _ = UNFINISHED[reply.finish]
        return Parsed(None, problem, code, parsed=False)
    return Parsed(None, NO_CALL, "no_tool_call", parsed=False)

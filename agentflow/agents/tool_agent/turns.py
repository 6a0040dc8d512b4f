"""One turn of a conversation with tools: ask, and judge whether the reply calls any."""

from __future__ import annotations

from collections.abc import Sequence

from agentflow.agents.base import UNFINISHED, AskContext, Parsed, RoleAttempt
from agentflow.agents.tool_agent.role import NO_CALL, Agent
from agentflow.llm.messages import Message, Reply, Request, Tool


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

"""Estimated tokens of requests and replies."""

from __future__ import annotations

from agentflow.llm.messages import Message, Reply, Request, Tool, ToolCall

CALL = ToolCall(id="c1", name="check", arguments="x" * 35)


def test_tools_and_calls_count_as_tokens() -> None:
    tool = Tool(name="check", description="d" * 400, parameters={"type": "object"})
    user, past = Message(role="user", text="x" * 40), Reply(text="", tool_calls=(CALL,)).message
    plain = Request(role="r", label="l", messages=(user,))
    assert plain.estimated_tokens == 10
    assert plain.model_copy(update={"messages": (user, past)}).estimated_tokens == 20
    # the tool's JSON: 400 characters of description, and 70 around it
    assert plain.model_copy(update={"tools": (tool,)}).estimated_tokens == 128


def test_a_reply_counts_text_reasoning_and_calls() -> None:
    reply = Reply(text="x" * 8, reasoning="y" * 4, tool_calls=(CALL,))
    assert reply.estimated_tokens == 13
    assert reply.message == Message(role="assistant", text="x" * 8, tool_calls=(CALL,))

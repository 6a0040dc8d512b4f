"""Replies from a list and from a function."""

from __future__ import annotations

import pytest

from agentflow.errors import UsageError
from agentflow.llm.messages import Reply
from tests.llm.helpers import ask
from tests.scripted import ScriptedClient


async def test_a_list_replies_in_order() -> None:
    given = Reply(text="half", finish="length")
    client = ScriptedClient(["one", "", given], name="s")
    assert await client.complete(ask()) == Reply(text="one", model="s")
    assert (await client.complete(ask())).finish == "empty"
    assert await client.complete(ask()) is given
    with pytest.raises(UsageError) as caught:
        await client.complete(ask(label="last/4"))
    assert str(caught.value) == "the script has 3 replies, but call 4 (last/4) needs another"
    await client.aclose()


async def test_a_function_sees_the_request() -> None:
    client = ScriptedClient(lambda request: request.label.upper())
    assert (await client.complete(ask(label="a/b"))).text == "A/B"
    assert [request.label for request in client.requests] == ["a/b"]

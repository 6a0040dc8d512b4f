"""Events about calls in progress."""

from __future__ import annotations

import asyncio

import pytest

from agentflow.app.design.notices import watch_calls
from agentflow.errors import UnreachableError
from agentflow.llm.messages import Reply, Request
from agentflow.models.choices import Models
from agentflow.runs import Event
from agentflow.runs.events import CallsEvent
from agentflow.runs.locations import Location
from tests.llm.helpers import ask
from tests.scripted import ScriptedClient


class Closing(ScriptedClient):
    """A client that counts its closings and yields to other tasks."""

    closed = 0

    async def complete(self, request: Request) -> Reply:
        await asyncio.sleep(0)
        return await super().complete(request)

    async def aclose(self) -> None:
        self.closed += 1


async def test_listeners_hear_the_start_and_end_of_every_call() -> None:
    client, heard = Closing(lambda request: request.label), []
    models = watch_calls(Models({"designer": client, "refiner": client}, {}), heard.append)
    assert models.name_of(models.clients) == "scripted"
    designer, refiner = models.clients["designer"], models.clients["refiner"]
    await asyncio.gather(designer.complete(ask(label="a")), refiner.complete(ask(label="b")))
    counts = [event.data["under_way"] for event in heard]
    assert counts == [1, 2, 1, 0]
    assert heard[0] == CallsEvent(Location("a"), 1, 0.0)
    await models.aclose()
    assert client.closed == 1


async def test_a_failed_call_is_no_longer_in_progress() -> None:
    def fail(_request: Request) -> str:
        raise UnreachableError("nothing answers")

    heard: list[Event] = []
    models = watch_calls(Models({"designer": ScriptedClient(fail)}, {}), heard.append)
    with pytest.raises(UnreachableError):
        await models.clients["designer"].complete(ask(label="a"))
    assert [event.data["under_way"] for event in heard] == [1, 0]

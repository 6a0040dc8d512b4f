"""Owns what listeners are told of calls under way, which is shown and never recorded."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from agentflow.app.design.models import Models
from agentflow.llm.client import Client
from agentflow.llm.messages import Reply, Request
from agentflow.llm.wrappers.budget import Budget
from agentflow.runs import Event
from agentflow.runs.events import CallsEvent
from agentflow.runs.places import Place


def watched(models: Models, budget: Budget, tell: Callable[[Event], None]) -> Models:
    """The same models; `tell` hears of every call that begins or ends."""
    counter = _Counter(budget, tell)
    return replace(models, clients=counter.around(models.clients))


@dataclass
class _Counter:
    budget: Budget
    tell: Callable[[Event], None]
    under_way: int = 0

    def around(self, clients: Mapping[str, Client]) -> dict[str, Client]:
        """Roles that share a client share its watcher, so that it is closed once."""
        by_client = {id(client): _Watched(client, self) for client in clients.values()}
        return {role: by_client[id(client)] for role, client in clients.items()}

    def change(self, label: str, by: int) -> None:
        self.under_way += by
        event = CallsEvent(Place.parse(label), self.under_way, self.budget.cost)
        self.tell(event.to_event())


class _Watched:
    """A client whose calls are counted while they last."""

    def __init__(self, inner: Client, counter: _Counter) -> None:
        self._inner, self._counter = inner, counter

    @property
    def name(self) -> str:
        return self._inner.name

    async def complete(self, request: Request) -> Reply:
        self._counter.change(request.label, 1)
        try:
            return await self._inner.complete(request)
        finally:
            self._counter.change(request.label, -1)

    async def aclose(self) -> None:
        await self._inner.aclose()

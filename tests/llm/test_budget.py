"""Nothing is asked once the budget is spent."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from agentflow.errors import BudgetSpentError
from agentflow.llm.budget import Budget, BudgetClient, BudgetSettings
from agentflow.llm.messages import Reply, Usage
from agentflow.llm.scripted import ScriptedClient
from tests.llm.helpers import ask


def scripted() -> ScriptedClient:
    return ScriptedClient(lambda _: Reply(text="x", usage=Usage(prompt=30, completion=20)))


async def test_calls_are_shared_by_all_clients_of_a_run() -> None:
    budget = Budget(BudgetSettings(calls=3))
    inner = scripted()
    one, other = BudgetClient(inner, budget), BudgetClient(inner, budget)
    for client in (one, other, one):
        await client.complete(ask())
    with pytest.raises(BudgetSpentError) as caught:
        await other.complete(ask())
    assert str(caught.value) == "the budget of 3 calls is spent"
    assert (budget.calls, len(inner.requests)) == (3, 3)


async def test_tokens() -> None:
    budget = Budget(BudgetSettings(tokens=51))
    client = BudgetClient(scripted(), budget)
    await client.complete(ask())
    await client.complete(ask())
    with pytest.raises(BudgetSpentError, match=r"^the budget of 51 tokens is spent$"):
        await client.complete(ask())
    assert budget.usage == Usage(prompt=60, completion=40)


async def test_without_limits_it_only_counts() -> None:
    budget = Budget()
    client = BudgetClient(scripted(), budget)
    await client.complete(ask())
    await client.aclose()
    assert (client.name, budget.calls, budget.usage.total) == ("scripted", 1, 50)


def test_a_budget_of_nothing_is_refused() -> None:
    with pytest.raises(ValidationError):
        BudgetSettings(calls=0)

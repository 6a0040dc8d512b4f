"""No calls are made once a limit is reached."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import ValidationError

from agentflow.errors import BudgetSpentError
from agentflow.llm.build import wrap
from agentflow.llm.messages import Reply, Usage
from agentflow.llm.wrappers.budget import FREE, Budget, BudgetClient, BudgetSettings, Price
from agentflow.llm.wrappers.record import CallLog
from tests.llm.helpers import ask
from tests.scripted import ScriptedClient


def scripted() -> ScriptedClient:
    return ScriptedClient(lambda _: Reply(text="x", usage=Usage(prompt=30, completion=20)))


async def test_all_clients_of_a_run_share_the_call_limit() -> None:
    budget = Budget(BudgetSettings(calls=3))
    inner = scripted()
    one, other = BudgetClient(inner, budget), BudgetClient(inner, budget)
    for client in (one, other, one):
        await client.complete(ask())
    with pytest.raises(BudgetSpentError) as caught:
        await other.complete(ask())
    assert str(caught.value) == "call limit reached (3)"
    assert (budget.calls, len(inner.requests)) == (3, 3)


async def test_tokens() -> None:
    budget = Budget(BudgetSettings(tokens=51))
    client = BudgetClient(scripted(), budget)
    await client.complete(ask())
    await client.complete(ask())
    with pytest.raises(BudgetSpentError, match=r"^token limit reached \(51\)$"):
        await client.complete(ask())
    assert budget.usage == Usage(prompt=60, completion=40)


async def test_without_limits_it_only_counts() -> None:
    budget = Budget()
    client = BudgetClient(scripted(), budget)
    await client.complete(ask())
    await client.aclose()
    assert (client.name, budget.calls, budget.usage.total) == ("scripted", 1, 50)


PRICE = Price(input=2.0, output=10.0, cached=0.5)


async def test_cost() -> None:
    # 30 prompt tokens at 2, 20 completion tokens at 10 per million: 0.00026 a call.
    budget = Budget(BudgetSettings(money=0.0005))
    client = BudgetClient(scripted(), budget, PRICE)
    await client.complete(ask())
    await client.complete(ask())
    assert budget.cost == pytest.approx(0.00052)
    with pytest.raises(BudgetSpentError, match=r"^cost limit reached \(0\.0005\)$"):
        await client.complete(ask())


def test_cached_tokens_have_their_own_price() -> None:
    usage = Usage(prompt=1_000_000, cached=400_000, completion=100_000, reasoning=90_000)
    assert PRICE.of(usage) == pytest.approx(0.6 * 2 + 0.4 * 0.5 + 0.1 * 10)
    assert Price(input=2, output=10).of(usage) == pytest.approx(2 + 1)
    assert PRICE.of(Usage(prompt=5, cached=50)) == pytest.approx(5 * 0.5 / 1e6)


async def test_the_cost_is_unknown_once_a_call_has_no_price() -> None:
    budget = Budget()
    assert budget.cost == 0
    await BudgetClient(scripted(), budget, PRICE).complete(ask())
    await BudgetClient(scripted(), budget).complete(ask())
    await BudgetClient(scripted(), budget, PRICE).complete(ask())
    assert budget.cost is None


async def test_limits_hold_without_reported_tokens_but_estimates_are_not_shown() -> None:
    budget = Budget(BudgetSettings(tokens=12))
    client = BudgetClient(ScriptedClient(["x" * 16, "y"]), budget, PRICE)
    await client.complete(ask("12345678"))  # 2 tokens asked, 4 answered, by estimate
    await client.complete(ask("1" * 20))
    with pytest.raises(BudgetSpentError, match=r"^token limit reached \(12\)$"):
        await client.complete(ask())
    assert (budget.usage, budget.cost) == (Usage(), None)
    free = Budget()
    await BudgetClient(ScriptedClient(["x"]), free, FREE).complete(ask())
    assert free.cost == 0


def test_a_budget_of_zero_is_rejected() -> None:
    with pytest.raises(ValidationError):
        BudgetSettings(calls=0)


async def test_a_resumed_run_repeats_recorded_calls_for_free(tmp_path: Path) -> None:
    path = tmp_path / "calls.jsonl"
    inner = scripted()
    with CallLog(path, pytest.fail) as call_log:
        client = wrap(inner, call_log=call_log, budget=Budget(BudgetSettings(calls=3)))
        for label in ("a/1", "a/2"):
            await client.complete(ask(label=label))
    with CallLog(path, pytest.fail) as call_log:
        budget = Budget(BudgetSettings(calls=3))
        for entry in call_log.calls():
            budget.count(entry.request, entry.reply, None)
        client = wrap(inner, call_log=call_log, budget=budget)
        for label in ("a/1", "b/1", "a/2"):
            await client.complete(ask(label=label))
        with pytest.raises(BudgetSpentError):
            await client.complete(ask(label="b/2"))
        assert (budget.calls, len(call_log), len(inner.requests)) == (3, 3, 3)

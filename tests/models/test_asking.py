"""Replies that are kept, and errors that say how to continue."""

from __future__ import annotations

from pathlib import Path

import pytest

from agentflow.errors import (
    BudgetSpentError,
    ConfigError,
    InterruptedRunError,
    RunError,
    UnreachableError,
)
from agentflow.llm.messages import Sampling
from agentflow.models.choices import CALLS, continuable, recorded_models
from agentflow.models.completion import complete_config
from tests.llm.helpers import ask
from tests.scripted import ScriptedClient

CONFIG = complete_config({"model": {"budget": {"calls": 2}}})


@pytest.mark.parametrize(
    ("raised", "told", "message"),
    [
        (UnreachableError("no answer"), UnreachableError, "no answer; wait a day"),
        (BudgetSpentError("2 calls"), ConfigError, "2 calls: raise the limit in model.budget; "),
        (KeyboardInterrupt(), InterruptedRunError, "interrupted; wait a day"),
        (RunError("damaged"), RunError, "damaged$"),
    ],
)
def test_what_ends_the_work_says_how_to_continue(
    raised: BaseException, told: type[Exception], message: str
) -> None:
    with pytest.raises(told, match=f"^{message}"), continuable("wait a day"):
        raise raised


async def test_what_is_on_record_is_not_asked_again_and_counts_in_the_budget(
    tmp_path: Path,
) -> None:
    first, second = ScriptedClient(lambda _: "first"), ScriptedClient(lambda _: "second")
    async with recorded_models(CONFIG, tmp_path, pytest.fail, first) as models:
        await models.clients["designer"].complete(ask(label="a"))
    async with recorded_models(CONFIG, tmp_path, pytest.fail, second) as models:
        designer = models.clients["designer"]
        assert models.budget.to_json() == {"calls": 1, "tokens": 0, "cost": None}
        assert (await designer.complete(ask(label="a"))).text == "first"
        assert (await designer.complete(ask(label="b"))).text == "second"
        with pytest.raises(BudgetSpentError):
            await designer.complete(ask(label="c"))
    assert len((tmp_path / CALLS).read_text().splitlines()) == 2
    assert models.choices["designer"].sampling == Sampling()

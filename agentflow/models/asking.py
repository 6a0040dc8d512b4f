"""Asks models in such a way that a command which ended early continues where it was.

Every reply is on record in the folder of the work before it is used, so the same command again
finds it there, free of charge.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

from agentflow.config.run import DesignConfig
from agentflow.errors import BudgetSpentError, ConfigError, EndpointError, InterruptedRunError
from agentflow.llm.client import Client
from agentflow.llm.wrappers.call_log import CallLog
from agentflow.models.clients import Models, open_models

CALLS = "calls.jsonl"
"""The call log in the folder."""
AGAIN = "run the same command again to continue"


@contextmanager
def continuable(again: str = AGAIN) -> Iterator[None]:
    """Say of what ends the work in it how to continue.

    Args:
        again: What to do, as the end of a sentence.

    Raises:
        EndpointError: The model cannot be used.
        ConfigError: The budget is spent.
        InterruptedRunError: Ctrl-C. An event loop has to end in here: it raises this only there.
    """
    try:
        yield
    except EndpointError as error:
        raise type(error)(f"{error}; {again}") from error
    except BudgetSpentError as error:
        raise ConfigError(f"{error}: raise the limit in model.budget; {again}") from None
    except KeyboardInterrupt:
        raise InterruptedRunError(f"interrupted; {again}") from None


@asynccontextmanager
async def recorded_models(
    config: DesignConfig,
    folder: Path,
    notify: Callable[[str], None],
    client: Client | None = None,
) -> AsyncIterator[Models]:
    """The models of a configuration, open; every reply is kept in a folder.

    Args:
        config: The models, and their budget, which the replies that are there have used in part.
        folder: The folder of the work, held by this process.
        notify: Receives remarks for the user.
        client: Answers in place of the configured models.

    Raises:
        RunError: What is on record is damaged, or nothing can be written.
        ConfigError: A key or a library is missing.
    """
    with CallLog(folder / CALLS, notify) as call_log:
        models = open_models(config, call_log, notify, client)
        try:
            yield models
        finally:
            await models.aclose()

"""The clients of models: calls are recorded, charged to a budget, kept within endpoint limits.

Every reply is on record in the folder of the work before it is used, so a command that ended early
continues where it was, free of charge.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Iterable, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from agentflow.agents.registry import scripts, split_model
from agentflow.config.run import DesignConfig, ModelConfig
from agentflow.errors import BudgetSpentError, ConfigError, EndpointError, InterruptedRunError
from agentflow.llm.build import open_client, wrap
from agentflow.llm.messages import Client
from agentflow.llm.procedural import ProceduralClient
from agentflow.llm.wrappers.budget import FREE, Budget, Price
from agentflow.llm.wrappers.limits import Limiters, LocalLimiters
from agentflow.llm.wrappers.record import CallLog, ReplayClient
from agentflow.models.choices import ModelChoice, choose_models, known_prices


@dataclass(frozen=True)
class Models:
    """The model of each role, and its client; roles with the same model share a client."""

    clients: Mapping[str, Client]
    choices: Mapping[str, ModelChoice]
    budget: Budget = field(default_factory=Budget)
    """What their calls have used."""

    def name_of(self, roles: Iterable[str]) -> str:
        """The name of these roles in results: one model, or each model with its roles."""
        roles_of: dict[str, list[str]] = {}
        for role in roles:
            roles_of.setdefault(self.clients[role].name, []).append(split_model(role)[0])
        if len(roles_of) == 1:
            return next(iter(roles_of))
        return "; ".join(f"{name} ({', '.join(own)})" for name, own in roles_of.items())

    async def aclose(self) -> None:
        """Close every client once."""
        for client in {id(client): client for client in self.clients.values()}.values():
            await client.aclose()


def open_models(
    config: DesignConfig,
    call_log: CallLog,
    notify: Callable[[str], None],
    client: Client | None = None,
    limiters: Limiters | None = None,
) -> Models:
    """The configured models, or one client in their place, recorded in a call log.

    What earlier processes recorded there counts in their budget. Those that are opened with the
    same `limiters` share them; by default, these models have their own.
    """
    model, limiters = config.model, limiters or LocalLimiters()
    choices = choose_models(model, config.settings.models)
    budget = _charge_budget(model, call_log)

    def record(inner: Client, price: Price | None) -> Client:
        return wrap(inner, call_log=call_log, budget=budget, price=price)

    if client is not None:
        recorded = record(client, model.prices.get(client.name))
        return Models(dict.fromkeys(choices, recorded), choices, budget)

    def open_choice(choice: ModelChoice) -> Client:
        if choice.local:
            return record(_local_client(choice, config.seed), FREE)
        endpoint = choice.endpoint()
        limits = limiters.of(endpoint.base_url, model.endpoint.limits)
        reached = open_client(endpoint, model.endpoint, limits, warn=notify, on_wait=notify)
        return record(reached, model.prices.get(choice.model))

    opened: dict[tuple[str | None, ...], Client] = {}
    clients = {}
    for role, choice in choices.items():
        key = (choice.model, choice.base_url, choice.key_variable)
        if key not in opened:
            opened[key] = open_choice(choice)
        clients[role] = opened[key]
    return Models(clients, choices, budget)


def _charge_budget(model: ModelConfig, call_log: CallLog) -> Budget:
    """The budget, charged with the calls that earlier processes recorded in a call log."""
    budget, prices = Budget(model.budget), known_prices(model)
    for call in call_log.calls():
        budget.count(call.request, call.reply, prices.get(call.model))
    return budget


def _local_client(choice: ModelChoice, seed: int) -> Client:
    if choice.procedural:
        return ProceduralClient(seed, scripts())
    from agentflow.models.local.libraries import require_libraries

    require_libraries("torch", "transformers")
    from agentflow.models.local.loading import LocalClient

    return LocalClient(Path(choice.model), seed)


def replay_models(config: DesignConfig, call_log: CallLog, *, budget_spent: bool) -> Models:
    """The configured models, answering from a call log only; see `ReplayClient`."""
    choices = choose_models(config.model, config.settings.models)
    clients = {
        role: ReplayClient(call_log, choice.display_name, budget_spent=budget_spent)
        for role, choice in choices.items()
    }
    return Models(clients, choices)


CALLS = "calls.jsonl"
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

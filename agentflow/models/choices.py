"""Which model answers for each role, where it is reached, what it costs; and the clients:
recorded, charged to a budget, kept within limits.

Every reply is on record in the folder of the work before it is used, so a command that ended early
continues where it was, free of charge.
"""

import os
from collections.abc import AsyncIterator, Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from agentflow.agents.registry import model_roles, scripts, split_model, with_model
from agentflow.config.run import PROCEDURAL, DesignConfig, ModelConfig, RoleModel
from agentflow.errors import (
    BudgetSpentError,
    ConfigError,
    EndpointError,
    InterruptedRunError,
    UnknownNameError,
)
from agentflow.llm.build import open_client, wrap
from agentflow.llm.endpoint.body import DEFAULT_BASE_URL, Endpoint
from agentflow.llm.messages import Client, Sampling, Usage
from agentflow.llm.procedural import ProceduralClient
from agentflow.llm.wrappers.budget import FREE, Budget, Price
from agentflow.llm.wrappers.limits import Limiters, LocalLimiters
from agentflow.llm.wrappers.record import CallLog, ReplayClient
from agentflow.metrics.usage import Cost


@dataclass(frozen=True)
class ModelChoice:
    """A model, its endpoint, and the environment variable of its key."""

    model: str
    base_url: str | None
    key_variable: str | None
    sampling: Sampling
    label: str | None = None
    """Name in results of a model in a folder, whose path is `model`."""

    @property
    def folder(self) -> Path | None:
        """The folder of a model in a folder."""
        return None if self.label is None else Path(self.model)

    @property
    def procedural(self) -> bool:
        """Whether this is the built-in model."""
        return self.model == PROCEDURAL

    @property
    def local(self) -> bool:
        """Whether it answers in this process: no endpoint, no key, no cost."""
        return self.procedural or self.label is not None

    @property
    def display_name(self) -> str:
        """The model's name in results."""
        return ProceduralClient.name if self.procedural else self.label or self.model

    def endpoint(self) -> Endpoint:
        """The endpoint, with the key from the environment."""
        key = os.environ.get(self.key_variable) if self.key_variable else None
        variable = self.key_variable or "model.roles.<role>.key_variable"
        return Endpoint(self.model, self.base_url or DEFAULT_BASE_URL, key, variable)


def choose_models(model: ModelConfig, arms: Sequence[str] = ()) -> dict[str, ModelChoice]:
    """The model of each role, and of each role that is asked of one of `arms`, other models.

    A role with its own base URL gets a key only if it names a variable: keys are never sent to an
    endpoint that they were not meant for.

    Raises:
        UnknownNameError: There is no such role.
        ConfigError: The budget limits money, and a model has no price.
    """
    roles = model_roles()
    for role in model.roles:
        if role not in roles:
            raise UnknownNameError("role in model.roles", role, roles)
    choices = {role: _choose_model(model, model.roles.get(role)) for role in roles}
    for name in arms:
        own = None if name == model.name else RoleModel(name=name)
        choices |= {
            with_model(role, name): _choose_model(model, model.roles.get(role, own))
            for role in roles
        }
    for choice in choices.values():
        priced = choice.local or choice.model in model.prices
        if model.budget.money is not None and not priced:
            raise ConfigError(
                f"model.budget.money needs a price for {choice.model!r}: set model.prices to "
                f"{{{choice.model}: {{input: ..., output: ...}}}}, per million tokens"
            )
    return choices


def _choose_model(model: ModelConfig, role: RoleModel | None) -> ModelChoice:
    if role is None:
        return ModelChoice(
            model.name, model.base_url, model.key_variable, model.sampling, model.label
        )
    variable = role.key_variable or (None if role.base_url else model.key_variable)
    sampling = role.sampling or model.sampling
    return ModelChoice(role.name, role.base_url or model.base_url, variable, sampling)


def known_prices(config: ModelConfig) -> dict[str, Price]:
    """Name of a recorded model -> price, if configured; models in this process are free."""
    free = {ProceduralClient.name, *filter(None, [config.label])}
    return {**config.prices, **dict.fromkeys(free, FREE)}


def cost_function(config: ModelConfig) -> Cost:
    """A function that returns the cost of a recorded call, or None without a price."""
    prices = known_prices(config)

    def cost(model: str, usage: Mapping[str, int]) -> float | None:
        price = prices.get(model)
        return None if price is None else price.of(Usage.model_validate(usage))

    return cost


@dataclass(frozen=True)
class Models:
    """The model of each role, and its client; roles with the same model share a client."""

    clients: Mapping[str, Client]
    choices: Mapping[str, ModelChoice]
    budget: Budget = field(default_factory=Budget)

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
    config: DesignConfig, folder: Path, notify: Callable[[str], None], client: Client | None = None
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

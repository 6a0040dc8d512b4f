"""The models of a run: which model answers for each role, its client, and its prices."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from agentflow.agents.registry import model_roles
from agentflow.config.run import PROCEDURAL, DesignConfig, ModelConfig, RoleModel
from agentflow.errors import ConfigError, UnknownNameError
from agentflow.llm.build import open_client, wrap
from agentflow.llm.client import Client
from agentflow.llm.endpoint.address import DEFAULT_BASE_URL, Endpoint
from agentflow.llm.messages import Sampling, Usage
from agentflow.llm.procedural import ProceduralClient
from agentflow.llm.wrappers.budget import Budget
from agentflow.llm.wrappers.limits import Limiters, LocalLimiters
from agentflow.llm.wrappers.prices import FREE, Price
from agentflow.llm.wrappers.record import ReplayClient
from agentflow.llm.wrappers.tape import Tape
from agentflow.metrics.usage import Cost
from agentflow.runs import Notify


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


def choose_models(model: ModelConfig) -> dict[str, ModelChoice]:
    """The model of each role.

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


@dataclass(frozen=True)
class Models:
    """The model of each role, and its client; roles with the same model share a client."""

    clients: Mapping[str, Client]
    choices: Mapping[str, ModelChoice]

    def name_of(self, roles: Iterable[str]) -> str:
        """The name of these roles in results: one model, or each model with its roles."""
        roles_of: dict[str, list[str]] = {}
        for role in roles:
            roles_of.setdefault(self.clients[role].name, []).append(role)
        if len(roles_of) == 1:
            return next(iter(roles_of))
        return "; ".join(f"{name} ({', '.join(own)})" for name, own in roles_of.items())

    async def aclose(self) -> None:
        """Close every client once."""
        for client in {id(client): client for client in self.clients.values()}.values():
            await client.aclose()


def charge_budget(model: ModelConfig, tape: Tape) -> Budget:
    """The budget, charged with the calls that earlier processes recorded on a tape."""
    budget, prices = Budget(model.budget), known_prices(model)
    for call in tape.calls():
        budget.count(call.request, call.reply, prices.get(call.model))
    return budget


def open_models(
    config: DesignConfig,
    tape: Tape,
    budget: Budget,
    notify: Notify,
    limiters: Limiters | None = None,
) -> Models:
    """The configured models, recorded on a tape and charged to a budget.

    Runs that pass the same `limiters` share them; by default, these models have their own.
    """
    settings, limiters = config.model.endpoint, limiters or LocalLimiters()

    def open_choice(choice: ModelChoice) -> Client:
        if choice.local:
            return wrap(_local_client(choice, config.seed), tape=tape, budget=budget, price=FREE)
        endpoint = choice.endpoint()
        return open_client(
            endpoint,
            settings=settings,
            tape=tape,
            budget=budget,
            price=config.model.prices.get(choice.model),
            limits=limiters.of(endpoint.base_url, settings.limits),
            warn=notify,
            on_wait=notify,
        )

    opened: dict[tuple[str | None, ...], Client] = {}
    clients = {}
    choices = choose_models(config.model)
    for role, choice in choices.items():
        key = (choice.model, choice.base_url, choice.key_variable)
        if key not in opened:
            opened[key] = open_choice(choice)
        clients[role] = opened[key]
    return Models(clients, choices)


def _local_client(choice: ModelChoice, seed: int) -> Client:
    if choice.procedural:
        return ProceduralClient(seed)
    from agentflow.training.libraries import require_libraries

    require_libraries("torch", "transformers")
    from agentflow.training.model.client import LocalClient

    return LocalClient(Path(choice.model), seed)


def use_client(client: Client, config: DesignConfig, tape: Tape, budget: Budget) -> Models:
    """One client for all roles, recorded on a tape and charged to a budget."""
    wrapped = wrap(client, tape=tape, budget=budget, price=config.model.prices.get(client.name))
    choices = choose_models(config.model)
    return Models(dict.fromkeys(choices, wrapped), choices)


def replay_models(config: DesignConfig, tape: Tape, *, budget_spent: bool) -> Models:
    """The configured models, answering from a tape only; see `ReplayClient`."""
    choices = choose_models(config.model)
    clients = {
        role: ReplayClient(tape, choice.display_name, budget_spent=budget_spent)
        for role, choice in choices.items()
    }
    return Models(clients, choices)


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

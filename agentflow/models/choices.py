"""Which model answers for each role, where it is reached, and what it costs."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from agentflow.agents.registry import model_roles, with_model
from agentflow.config.run import PROCEDURAL, ModelConfig, RoleModel
from agentflow.errors import ConfigError, UnknownNameError
from agentflow.llm.endpoint.body import DEFAULT_BASE_URL, Endpoint
from agentflow.llm.messages import Sampling, Usage
from agentflow.llm.procedural import ProceduralClient
from agentflow.llm.wrappers.budget import FREE, Price
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

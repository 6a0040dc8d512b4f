"""Owns who answers: the procedural model or an endpoint, from configuration and environment."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agentflow.agents.registry import model_roles
from agentflow.config.run import (
    PROCEDURAL,
    DesignConfig,
    ModelConfig,
    RoleModel,
    build,
    load,
    override,
    put,
)
from agentflow.errors import ConfigError, UnknownNameError
from agentflow.llm.build import open_client, wrap
from agentflow.llm.client import Client
from agentflow.llm.endpoint.address import DEFAULT_BASE_URL, Endpoint
from agentflow.llm.messages import Sampling
from agentflow.llm.procedural import ProceduralClient
from agentflow.llm.wrappers.budget import Budget
from agentflow.llm.wrappers.limits import Limiter
from agentflow.llm.wrappers.prices import FREE
from agentflow.llm.wrappers.record import ReplayClient
from agentflow.llm.wrappers.tape import Tape


def with_environment(document: Mapping[str, Any], environ: Mapping[str, str]) -> dict[str, Any]:
    """Fill in what neither command line nor YAML says about the model (spec 4.1).

    A key alone never spends money: it takes a model's name to leave the procedural model.
    """
    result = dict(document)
    given = result.get("model", {})
    if not isinstance(given, Mapping):
        return result
    model = dict(given)
    name = environ.get("AGENTFLOW_MODEL", "").strip()
    url = environ.get("OPENAI_BASE_URL", "").strip()
    if name:
        model.setdefault("name", name)
    if url and model.get("name", PROCEDURAL) != PROCEDURAL:
        model.setdefault("base_url", url)
    return {**result, "model": model} if model else result


def configured(
    path: Path | None, settings: Iterable[str], options: Mapping[str, Any]
) -> DesignConfig:
    """The configuration of a run: options over `--set` over the YAML file over the environment.

    Args:
        path: The YAML file, if any.
        settings: `a.b=value` each.
        options: Dotted configuration keys; None means not given.

    Raises:
        ConfigError: A key is unknown or a value out of range.
    """
    document = override(load(path) if path is not None else {}, settings)
    for key, value in options.items():
        if value is not None:
            document = put(document, key, value)
    return completed(document)


def completed(document: Mapping[str, Any]) -> DesignConfig:
    """The configuration of a run, with what the environment says about the model.

    Raises:
        ConfigError: A key is unknown, a value out of range, or a base URL stands without a model.
    """
    config = build(with_environment(document, os.environ))
    demand_name(config.model)
    return config


def demand_name(model: ModelConfig) -> None:
    """Refuse a base URL that nobody would ask, since no model is named at it.

    Raises:
        ConfigError: There is one; `procedural` by name is a choice, and as the default is none.
    """
    if model.base_url is None or "name" in model.model_fields_set:
        return
    if not any(role.name != PROCEDURAL and role.base_url is None for role in model.roles.values()):
        raise ConfigError(
            "a base URL is given, and no model: name the model with --model (model.name, "
            "AGENTFLOW_MODEL)"
        )


def shown(config: DesignConfig) -> dict[str, Any]:
    """The configuration as it may be written down: base URLs without their credentials."""
    document = config.model_dump(mode="json")
    model = document["model"]
    for part in (model, *model["roles"].values()):
        if part["base_url"] is not None:
            part["base_url"] = Endpoint(part["name"], part["base_url"]).base_url
    return document


def with_credentials(config: DesignConfig) -> set[str]:
    """The base URLs that hold a user or a query, which `shown` leaves out."""
    urls = [config.model.base_url, *(role.base_url for role in config.model.roles.values())]
    return {url for url in urls if url and ("@" in url or "?" in url)}


@dataclass(frozen=True)
class Answerer:
    """Which model answers at which endpoint with which key."""

    model: str
    base_url: str | None
    key_variable: str | None
    sampling: Sampling

    @property
    def procedural(self) -> bool:
        """Whether no endpoint is asked."""
        return self.model == PROCEDURAL

    @property
    def shown(self) -> str:
        """The model's name in results."""
        return ProceduralClient.name if self.procedural else self.model

    def endpoint(self) -> Endpoint:
        """Where its requests go, with the key from the environment.

        Raises:
            ConfigError: Base URL or key cannot be used.
        """
        key = os.environ.get(self.key_variable) if self.key_variable else None
        variable = self.key_variable or "model.roles.<role>.key_variable"
        return Endpoint(self.model, self.base_url or DEFAULT_BASE_URL, key, variable)


def answerers(model: ModelConfig) -> dict[str, Answerer]:
    """Who answers for each role.

    A role with a base URL of its own gets a key only by naming its variable: no key is ever sent
    to an endpoint that it was not given for.

    Raises:
        UnknownNameError: There is no such role.
        ConfigError: A money budget, and a model without a price.
    """
    roles = model_roles()
    for role in model.roles:
        if role not in roles:
            raise UnknownNameError("role in model.roles", role, roles)
    found = {role: _answerer(model, model.roles.get(role)) for role in roles}
    for item in found.values():
        if (
            model.budget.money is not None
            and not item.procedural
            and item.model not in model.prices
        ):
            raise ConfigError(
                f"model.budget.money needs a price for {item.model!r}: set model.prices to "
                f"{{{item.model}: {{input: ..., output: ...}}}}, per million tokens"
            )
    return found


def _answerer(model: ModelConfig, own: RoleModel | None) -> Answerer:
    if own is None:
        return Answerer(model.name, model.base_url, model.key_variable, model.sampling)
    variable = own.key_variable or (None if own.base_url else model.key_variable)
    sampling = own.sampling or model.sampling
    return Answerer(own.name, own.base_url or model.base_url, variable, sampling)


@dataclass(frozen=True)
class Models:
    """Who answers, ready to be asked; roles with the same model share its client."""

    clients: Mapping[str, Client]
    """By role."""
    samplings: Mapping[str, Sampling]

    @property
    def name(self) -> str:
        """As shown in results: one name, or each name with its roles."""
        roles: dict[str, list[str]] = {}
        for role, client in self.clients.items():
            roles.setdefault(client.name, []).append(role)
        if len(roles) == 1:
            return next(iter(roles))
        return "; ".join(f"{name} ({', '.join(of)})" for name, of in roles.items())

    async def aclose(self) -> None:
        """Close every client once."""
        for client in {id(client): client for client in self.clients.values()}.values():
            await client.aclose()


def open_models(
    config: DesignConfig,
    tape: Tape,
    budget: Budget,
    say: Callable[[str], None],
    limiters: dict[str, Limiter],
) -> Models:
    """The clients of a run, with its record and its budget around them.

    Limiters are taken from `limiters`, by base URL, and put there: runs may share them.

    Raises:
        UnknownNameError: A model is configured for a role that does not exist.
        ConfigError: Base URL, key or price cannot be used.
    """
    opened: dict[tuple[str, ...], Client] = {}
    clients = {}
    found = answerers(config.model)
    for role, item in found.items():
        key = (item.model, item.base_url or "", item.key_variable or "")
        if key not in opened:
            opened[key] = _open(item, config, tape, budget, say, limiters)
        clients[role] = opened[key]
    return Models(clients, {role: item.sampling for role, item in found.items()})


def answered_by(client: Client, config: DesignConfig, tape: Tape, budget: Budget) -> Models:
    """One client for all roles, with the record and the budget of a run around it."""
    wrapped = wrap(client, tape=tape, budget=budget, price=config.model.prices.get(client.name))
    found = answerers(config.model)
    return Models(
        dict.fromkeys(found, wrapped), {role: item.sampling for role, item in found.items()}
    )


def replaying(config: DesignConfig, tape: Tape, *, budget_spent: bool) -> Models:
    """The same roles answered from a record alone; see `ReplayClient`."""
    found = answerers(config.model)
    clients = {
        role: ReplayClient(tape, item.shown, budget_spent=budget_spent)
        for role, item in found.items()
    }
    return Models(clients, {role: item.sampling for role, item in found.items()})


def _open(
    item: Answerer,
    config: DesignConfig,
    tape: Tape,
    budget: Budget,
    say: Callable[[str], None],
    limiters: dict[str, Limiter],
) -> Client:
    if item.procedural:
        return wrap(ProceduralClient(config.seed), tape=tape, budget=budget, price=FREE)
    endpoint, settings = item.endpoint(), config.model.endpoint
    return open_client(
        endpoint,
        settings=settings,
        tape=tape,
        budget=budget,
        price=config.model.prices.get(item.model),
        limiter=limiters.setdefault(endpoint.base_url, Limiter(settings.limits)),
        warn=say,
        on_wait=say,
    )

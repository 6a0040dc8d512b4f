"""The configured strategy: what it searches, and what it gets."""

from __future__ import annotations

from inspect import signature
from random import Random
from typing import Any

from pydantic import BaseModel

from agentflow.errors import ConfigError
from agentflow.search.pooled.pool import PooledStrategy
from agentflow.search.registry import STRATEGIES
from agentflow.search.settings import SearchSettings


def deals_budget(name: str) -> bool:
    """Whether the strategy of this name deals the budget of a whole run."""
    strategy = STRATEGIES[name]
    return isinstance(strategy, type) and issubclass(strategy, PooledStrategy)


def searches_whole_run(settings: SearchSettings) -> bool:
    """Whether one search deals the budget of the whole run; 0 rounds skip every search."""
    return settings.rounds > 0 and deals_budget(settings.strategy)


def pooled(settings: SearchSettings) -> PooledStrategy | None:
    """The configured strategy if it deals the budget of the whole run; None if it does not."""
    if not searches_whole_run(settings):
        return None
    strategy: PooledStrategy = STRATEGIES[settings.strategy](**extras(settings))
    return strategy


def extras(settings: SearchSettings, rng: Random | None = None) -> dict[str, Any]:
    """What the configured strategy gets by name: `rng` and `options`, as far as it has them.

    Raises:
        pydantic.ValidationError: Its model refuses the options.
        ConfigError: There are options, but it takes none.
    """
    strategy, model = STRATEGIES[settings.strategy], options_model(settings.strategy)
    found: dict[str, Any] = {}
    if rng is not None and "rng" in signature(strategy).parameters:
        found["rng"] = rng
    if model is not None:
        found["options"] = model.model_validate(settings.options)
    elif settings.options:
        raise ConfigError(
            f"the search strategy {settings.strategy} takes no options: remove "
            f"settings.search.options ({', '.join(settings.options)})"
        )
    return found


def options_model(name: str) -> type[BaseModel] | None:
    """The model of a strategy's options; None if it takes none.

    Raises:
        ConfigError: They are not annotated with a model, or a name in annotations is unknown.
    """
    if "options" not in signature(STRATEGIES[name]).parameters:
        return None
    try:
        model = signature(STRATEGIES[name], eval_str=True).parameters["options"].annotation
    except NameError as error:
        raise ConfigError(f"{STRATEGIES.describe(name)} has annotations where {error}") from None
    if isinstance(model, type) and issubclass(model, BaseModel):
        return model
    raise ConfigError(f"{STRATEGIES.describe(name)} must annotate options with a pydantic model")

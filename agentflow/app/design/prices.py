"""Owns what the calls of a run cost, by the prices of its own configuration."""

from __future__ import annotations

from collections.abc import Mapping

from agentflow.config.run import ModelConfig
from agentflow.llm.messages import Usage
from agentflow.llm.procedural import ProceduralClient
from agentflow.llm.wrappers.prices import FREE, Price
from agentflow.metrics.usage import Cost


def prices_of(config: ModelConfig) -> dict[str, Price]:
    """Name in the record -> price, where one is known; the procedural model is always free."""
    return {**config.prices, ProceduralClient.name: FREE}


def cost_by(config: ModelConfig) -> Cost:
    """What a recorded call cost."""
    prices = prices_of(config)

    def cost(model: str, usage: Mapping[str, int]) -> float | None:
        price = prices.get(model)
        return None if price is None else price.of(Usage.model_validate(usage))

    return cost

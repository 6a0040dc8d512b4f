"""Checking a configured endpoint, for `agentflow doctor`."""

from __future__ import annotations

import asyncio

from agentflow.app.design.models import choose_models
from agentflow.config.run import DesignConfig
from agentflow.errors import ConfigError, UnknownNameError
from agentflow.llm.doctor import Diagnosis, diagnose

_IDLE_S, _TOTAL_S = 60.0, 120.0
"""Longest waits for one small reply, shorter than a run's."""


def check_endpoint(config: DesignConfig, role: str) -> Diagnosis:
    """Send one small request to the model of a role.

    Raises:
        UnknownNameError: There is no such role.
        ConfigError: It has no endpoint, or base URL or key cannot be used.
    """
    found = choose_models(config.model)
    if role not in found:
        raise UnknownNameError("role", role, found)
    if found[role].procedural:
        raise ConfigError(
            "the procedural model has no endpoint to check; name a model with --model or "
            "AGENTFLOW_MODEL"
        )
    http = config.model.endpoint.http
    settings = http.model_copy(
        update={"idle_s": min(http.idle_s, _IDLE_S), "total_s": min(http.total_s, _TOTAL_S)}
    )
    return asyncio.run(diagnose(found[role].endpoint(), settings))

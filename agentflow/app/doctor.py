"""Checks a configured endpoint, for `agentflow doctor`."""

from __future__ import annotations

import asyncio

from agentflow.app.design.models import choose_models
from agentflow.config.run import DesignConfig
from agentflow.errors import ConfigError, UnknownNameError
from agentflow.llm.doctor import Diagnosis, diagnose

_IDLE_S, _TOTAL_S = 60.0, 120.0
"""Time-outs for one small reply, shorter than in a run."""


def check_endpoint(config: DesignConfig, role: str) -> Diagnosis:
    """Send one small request to the model of a role.

    Raises:
        UnknownNameError: There is no such role.
        ConfigError: The model has no endpoint, or its base URL or key cannot be used.
    """
    choices = choose_models(config.model)
    if role not in choices:
        raise UnknownNameError("role", role, choices)
    if choices[role].procedural:
        raise ConfigError(
            "the procedural model has no endpoint to check; name a model with --model or "
            "AGENTFLOW_MODEL"
        )
    http = config.model.endpoint.http
    settings = http.model_copy(
        update={"idle_s": min(http.idle_s, _IDLE_S), "total_s": min(http.total_s, _TOTAL_S)}
    )
    return asyncio.run(diagnose(choices[role].endpoint(), settings))

"""Owns who answers: the procedural model or an endpoint, from configuration and environment."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from agentflow.config import PROCEDURAL, DesignConfig, ModelConfig, build, load, override
from agentflow.llm.budget import Budget
from agentflow.llm.build import open_client, wrap
from agentflow.llm.client import Client
from agentflow.llm.endpoint import Endpoint
from agentflow.llm.procedural import ProceduralClient
from agentflow.llm.tape import Tape

KEY_VARIABLE = "OPENAI_API_KEY"


def with_environment(document: Mapping[str, Any], environ: Mapping[str, str]) -> dict[str, Any]:
    """Fill in what neither command line nor YAML says about the model (spec 4.1).

    A key alone never spends money: it takes a model's name to leave the procedural model.
    """
    result = dict(document)
    model = dict(result.get("model") or {})
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
            document = override(document, [f"{key}={json.dumps(value)}"])
    return build(with_environment(document, os.environ))


def shown(config: DesignConfig) -> dict[str, Any]:
    """The configuration as it may be written down: a base URL without its credentials."""
    document = config.model_dump(mode="json")
    url = config.model.base_url
    if url is not None:
        document["model"]["base_url"] = Endpoint(config.model.name, url).base_url
    return document


def open_model(
    config: DesignConfig, tape: Tape, budget: Budget, say: Callable[[str], None]
) -> Client:
    """The client of a run, with its record and its budget around it.

    Raises:
        ConfigError: Base URL or key cannot be used.
    """
    model: ModelConfig = config.model
    if model.name == PROCEDURAL:
        return wrap(ProceduralClient(config.seed), tape=tape, budget=budget)
    return open_client(
        model=model.name,
        base_url=model.base_url,
        api_key=os.environ.get(KEY_VARIABLE),
        key_variable=KEY_VARIABLE,
        settings=model.endpoint,
        tape=tape,
        budget=budget,
        warn=say,
        on_wait=say,
    )

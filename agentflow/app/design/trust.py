"""Refuses hosts and key variables that only a file names: the file may be somebody else's.

A run directory, a sweep or a configuration file decides where prompts are sent and which
environment variable is sent along as the key.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from agentflow.app.design.models import ModelChoice, choose_models
from agentflow.config.run import KEY_VARIABLE, ModelConfig, build_config
from agentflow.errors import ConfigError
from agentflow.llm.endpoint.address import DEFAULT_BASE_URL, Endpoint
from agentflow.runs import read_document

Approve = Callable[[str], bool]
"""Whether the user allows what a sentence says."""


def refuse(_sentence: str) -> bool:
    """Allow nothing."""
    return False


def require_trust(
    source: Path, models: Iterable[ModelConfig], named: Mapping[str, Any], approve: Approve
) -> None:
    """Refuse hosts and key variables that neither the user nor `approve` allows.

    Args:
        source: The file or directory that the models come from.
        models: Their configurations.
        named: Configuration keys that the user gave; the environment counts as well.
        approve: Is asked once, about everything else.

    Raises:
        ConfigError: It does not allow it.
    """
    foreign = list(dict.fromkeys(place for model in models for place in unnamed(model, named)))
    if not foreign:
        return
    sentence = f"{source} sends prompts to {' and to '.join(foreign)}"
    if not approve(sentence):
        raise ConfigError(
            f"{sentence}, which you have not named on the command line or in the environment; "
            "check it, then allow it with --trust (in Python: trust=True)"
        )


def require_trusted_run(path: Path, approve: Approve, named: Mapping[str, Any]) -> None:
    """`require_trust` for an unfinished run."""
    model = build_config(read_document(path).get("config")).model
    require_trust(path, [model], named, approve)


def unnamed(model: ModelConfig, named: Mapping[str, Any]) -> Iterator[str]:
    """Each host of a configuration, with its key, that the user has not named both of."""
    groups = list(_groups(named))
    urls = {os.environ.get("OPENAI_BASE_URL", "").strip() or DEFAULT_BASE_URL}
    urls |= {str(group["base_url"]) for group in groups if group.get("base_url")}
    origins = {Endpoint("", url).origin for url in urls}
    variables = {KEY_VARIABLE, *(group.get("key_variable") for group in groups), None}
    for choice in choose_models(model).values():
        if choice.procedural:
            continue
        origin = _origin(choice)
        if origin not in origins or choice.key_variable not in variables:
            key = f"the key in {choice.key_variable}" if choice.key_variable else "no key"
            yield f"{origin} with {key}"


def trust_option(models: Iterable[ModelConfig]) -> str:
    """What commands that continue the user's own work need: " --trust" or ""."""
    return " --trust" if any(any(unnamed(model, {})) for model in models) else ""


def _origin(choice: ModelChoice) -> str:
    return Endpoint(choice.model, choice.base_url or DEFAULT_BASE_URL).origin


def _groups(named: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """The settings of the model and of each role's model."""
    model = named.get("model")
    if isinstance(model, Mapping):
        yield model
        roles = model.get("roles")
        yield from (role for role in dict(roles or {}).values() if isinstance(role, Mapping))

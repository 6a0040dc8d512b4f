"""Refuses hosts, key variables and programs that only a file names: it may be somebody else's.

A run directory, a sweep or a configuration file decides where prompts are sent, which environment
variable is sent along as the key, and which program the workflow `external` runs.
"""

import os
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from agentflow.config.run import KEY_VARIABLE, DesignConfig, ModelConfig, build_config
from agentflow.errors import ConfigError
from agentflow.llm.endpoint.body import DEFAULT_BASE_URL, Endpoint
from agentflow.models.choices import choose_models
from agentflow.runs import read_document

Approve = Callable[[str], bool]
"""Whether the user allows what a sentence says."""


def refuse(_sentence: str) -> bool:
    """Allow nothing."""
    return False


def require_trust(
    source: Path, configs: Iterable[DesignConfig], named: Mapping[str, Any], approve: Approve
) -> None:
    """Refuse hosts, key variables and programs that neither the user nor `approve` allows.

    Args:
        source: The file or directory that the configurations come from.
        configs: The configurations.
        named: Configuration keys that the user gave; the environment counts as well.
        approve: Is asked once, about everything else.

    Raises:
        ConfigError: It does not allow it.
    """
    configs = list(configs)
    hosts = dict.fromkeys(host for config in configs for host in unnamed(config.model, named))
    programs = dict.fromkeys(text for config in configs for text in _programs(config, named))
    parts = [f"sends prompts to {' and to '.join(hosts)}"] if hosts else []
    parts += [f"runs {' and '.join(programs)}"] if programs else []
    if not parts:
        return
    sentence = f"{source} {' and '.join(parts)}"
    if not approve(sentence):
        raise ConfigError(
            f"{sentence}, which you have not named on the command line or in the environment; "
            "check it, then allow it with --trust (in Python: trust=True)"
        )


def require_trusted_run(path: Path, approve: Approve, named: Mapping[str, Any]) -> None:
    """`require_trust` for an unfinished run."""
    config = build_config(read_document(path).get("config"))
    require_trust(path, [config], named, approve)


def unnamed(model: ModelConfig, named: Mapping[str, Any]) -> Iterator[str]:
    """Each host of a configuration, with its key, that the user has not named both of."""
    groups = list(_groups(named))
    urls = {os.environ.get("OPENAI_BASE_URL", "").strip() or DEFAULT_BASE_URL}
    urls |= {str(group["base_url"]) for group in groups if group.get("base_url")}
    origins = {Endpoint("", url).origin for url in urls}
    variables = {KEY_VARIABLE, *(group.get("key_variable") for group in groups), None}
    for choice in choose_models(model).values():
        if choice.local:
            continue
        origin = Endpoint(choice.model, choice.base_url or DEFAULT_BASE_URL).origin
        if origin not in origins or choice.key_variable not in variables:
            key = f"the key in {choice.key_variable}" if choice.key_variable else "no key"
            yield f"{origin} with {key}"


def trust_option(configs: Iterable[DesignConfig]) -> str:
    """What commands that continue the user's own work need: " --trust" or ""."""
    foreign = (any(unnamed(c.model, {})) or any(_programs(c, {})) for c in configs)
    return " --trust" if any(foreign) else ""


def _programs(config: DesignConfig, named: Mapping[str, Any]) -> Iterator[str]:
    """The program of a configuration, with its variables, unless the user has named them all."""
    external = config.settings.external
    settings = named.get("settings")
    group = settings.get("external") if isinstance(settings, Mapping) else None
    given = group if isinstance(group, Mapping) else {}
    risks = (name for name in ("command", "shell", "variables") if getattr(external, name))
    if external.command and any(name not in given for name in risks):
        command = external.command
        line = command if isinstance(command, str) else shlex.join(command)
        keys = f" with the variables {', '.join(external.variables)}" if external.variables else ""
        yield f"the program {line!r}{keys}"


def _groups(named: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """The settings of the model and of each role's model."""
    model = named.get("model")
    if isinstance(model, Mapping):
        yield model
        roles = model.get("roles")
        yield from (role for role in dict(roles or {}).values() if isinstance(role, Mapping))

"""Loads run configurations from options, settings, YAML files and the environment."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from agentflow.app.design.trust import Approve, refuse, require_trust
from agentflow.config.run import (
    PROCEDURAL,
    DesignConfig,
    ModelConfig,
    apply_settings,
    build_config,
    load_document,
    set_key,
)
from agentflow.env.tasks.knobs import deep_merge
from agentflow.errors import ConfigError
from agentflow.llm.endpoint.address import Endpoint


def load_config(
    path: Path | None,
    settings: Iterable[str],
    options: Mapping[str, Any],
    approve: Approve = refuse,
) -> DesignConfig:
    """Load a configuration; options override `--set`, then the file, then the environment.

    Args:
        path: The YAML file, if any.
        settings: Strings `a.b=value`.
        options: Dotted configuration keys; None means not given.
        approve: Is asked about hosts, key variables and programs that only the file names.
    """
    settings = list(settings)
    named = set_options({}, settings, options)
    if path is None:
        return complete_config(named)
    config = complete_config(set_options(load_document(path), settings, options))
    require_trust(path, [config], named, approve)
    return config


def set_options(
    document: Mapping[str, Any], settings: Iterable[str], options: Mapping[str, Any]
) -> dict[str, Any]:
    """The document with the settings, then the options that are not None."""
    result = apply_settings(document, settings)
    for key, value in options.items():
        if value is not None:
            result = set_key(result, key, value)
    return result


def complete_config(document: Mapping[str, Any]) -> DesignConfig:
    """Validate a document, with missing model settings taken from the environment.

    Raises:
        ConfigError: A key is unknown, a value is out of range, or a base URL has no model.
    """
    filled = fill_from_environment(document, os.environ)
    config = build_config(complete_local_model(filled))
    require_model_name(config.model)
    return config


def fill_from_environment(
    document: Mapping[str, Any], environ: Mapping[str, str]
) -> dict[str, Any]:
    """Add the model's name and base URL from the environment if the document lacks them.

    An API key alone never causes cost: only a model name replaces the procedural model.
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


PATH_STARTS = ("./", "../", "~")
"""A model's name with such a start is a path: no endpoint has such names."""


def complete_local_model(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """Add the label of a model in a folder, and, if it only writes whole machines, what that means.

    Such a model cannot revise a machine: unless the document says otherwise, the workflow is
    `single`, without revisions. A name with a base URL is a name at an endpoint.

    Raises:
        ConfigError: The model's name is a folder without a model, or a path where no folder is.
    """
    model = document.get("model")
    given = model if isinstance(model, Mapping) else {}
    name = str(given.get("name", PROCEDURAL))
    path = Path(name)
    if given.get("base_url") is not None or "label" in given:
        return document
    if not path.is_dir():
        if path.is_absolute() or name.startswith(PATH_STARTS):
            raise ConfigError(f"{name} is not a folder; name a model's folder, or a model")
        return document
    from agentflow.training.model.folder import find_model, read_folder

    path = find_model(path)
    folder = read_folder(path)
    named = {"model": {"name": str(path), "label": folder.label}}
    fitting = {"workflow": "single", "settings": {"search": {"rounds": 0}}}
    return deep_merge(deep_merge(fitting if folder.whole_machines_only else {}, document), named)


def require_model_name(model: ModelConfig) -> None:
    """Refuse a base URL that no model uses, unless `procedural` is named explicitly."""
    if model.base_url is None or "name" in model.model_fields_set:
        return
    if not any(role.name != PROCEDURAL and role.base_url is None for role in model.roles.values()):
        raise ConfigError(
            "a base URL is given without a model: name the model with --model (model.name, "
            "AGENTFLOW_MODEL)"
        )


ONLY_RUNS = ("workflow", "settings", "rationale_from", "max_retry", "verify", "keep_rollouts")
"""Keys that decide nothing but how a run goes."""


def find_unused_setting(config: DesignConfig, others: Iterable[str] = ()) -> str | None:
    """The first key of a configuration that is set although nothing uses it; None if none is.

    Args:
        config: As given, for something that is not a run.
        others: Keys that are not used either, besides `ONLY_RUNS`.
    """
    given = config.model.model_dump(exclude={"label"}, exclude_unset=True)
    default = complete_config({"model": given})  # a model in a folder may have its own workflow
    unused = (*ONLY_RUNS, *others)
    return next((key for key in unused if getattr(config, key) != getattr(default, key)), None)


def config_json(config: DesignConfig) -> dict[str, Any]:
    """The configuration to write to files: base URLs without credentials."""
    document = config.model_dump(mode="json")
    model = document["model"]
    for part in (model, *model["roles"].values()):
        if part["base_url"] is not None:
            part["base_url"] = Endpoint(part["name"], part["base_url"]).base_url
    return document


def urls_with_credentials(config: DesignConfig) -> set[str]:
    """The base URLs with a user or a query, which `config_json` removes."""
    urls = [config.model.base_url, *(role.base_url for role in config.model.roles.values())]
    return {url for url in urls if url and ("@" in url or "?" in url)}

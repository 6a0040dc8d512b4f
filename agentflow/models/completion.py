"""Completes configurations: the model from the environment, and what a model in a folder is for."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from agentflow.config.run import PROCEDURAL, DesignConfig, ModelConfig, build_config
from agentflow.errors import ConfigError
from agentflow.files.yaml import deep_merge
from agentflow.models.local.folder import find_model, read_folder


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
    `single`, without revisions. A name with a base URL is a name at an endpoint, and `procedural`
    is the built-in model, also where a folder has this name.

    Raises:
        ConfigError: The model's name is a folder without a model, or a path where no folder is.
    """
    model = document.get("model")
    given = model if isinstance(model, Mapping) else {}
    name = str(given.get("name", PROCEDURAL))
    path = Path(name)
    if given.get("base_url") is not None or "label" in given or name == PROCEDURAL:
        return document
    if not path.is_dir():
        in_a_folder_here = len(path.parts) > 1 and Path(path.parts[0]).is_dir()
        if path.is_absolute() or name.startswith(PATH_STARTS) or in_a_folder_here:
            raise ConfigError(f"{name} is not a folder; name a model's folder, or a model")
        return document
    path = find_model(path)
    folder = read_folder(path)
    named = {"model": {"name": str(path), "label": folder.label}}
    fitting = {"workflow": "single", "settings": {"search": {"rounds": 0}}}
    return deep_merge(deep_merge(fitting if folder.whole_machines_only else {}, document), named)


def require_model_name(model: ModelConfig) -> None:
    """Refuse a base URL that no model uses, unless `procedural` is named explicitly, and a folder
    that would be taken for the name of a model at an endpoint."""
    at_an_endpoint = model.name != PROCEDURAL and model.label is None
    if at_an_endpoint and model.base_url is None and Path(model.name).is_dir():
        raise ConfigError(f"{model.name} is a folder: name it with --model or as model.name")
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

"""Loads run configurations from options, settings and YAML files."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from agentflow.app.design.trust import Approve, refuse, require_trust
from agentflow.config.run import DesignConfig, apply_settings, load_document, set_key
from agentflow.llm.endpoint.body import Endpoint
from agentflow.models.completion import complete_config


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

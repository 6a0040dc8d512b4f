"""Owns how a configuration is shown: every key resolved, and where its value came from."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from agentflow.app.design.config import config_json, fill_from_environment, load_config
from agentflow.app.design.plan import RunPlan
from agentflow.config.run import load, override

DEFAULT, SETTING, ENVIRONMENT = "default", "--set", "environment"
COLUMN = 52
"""Where the comments begin that say where a value came from."""


def resolved(path: Path | None, settings: Iterable[str]) -> dict[str, Any]:
    """The configuration of a run: `config`, and `from`: dotted key -> where its value came from.

    Args:
        path: The YAML file, if any.
        settings: `a.b=value` each.

    Raises:
        UsageError: A key, a name or a value is wrong, as it would be for a run.
    """
    given = list(settings)
    plan = RunPlan.of(load_config(path, given, {}))
    config = config_json(plan.config)
    whole, layers = _layers(path, given)
    origins = {
        ".".join(keys): _origin(keys, layers) if _holds(whole, keys) else DEFAULT
        for keys, _ in _leaves(config)
    }
    return {"config": config, "from": origins}


def as_yaml(found: Mapping[str, Any]) -> str:
    """What `resolved` gives, as a configuration file that says of every line whence it is."""
    return "\n".join(_lines(found["config"], (), found["from"]))


def _layers(
    path: Path | None, settings: list[str]
) -> tuple[Mapping[str, Any], list[tuple[str, Mapping[str, Any]]]]:
    """What was given in all, and name and document of each source; what counts most, first."""
    file = load(path) if path is not None else {}
    laid = override(file, settings)
    filled = fill_from_environment(laid, os.environ)
    before = {keys for keys, _ in _leaves(laid)}
    added = [keys for keys, _ in _leaves(filled) if keys not in before]
    environment = {"model": {keys[-1]: True for keys in added}} if added else {}
    return filled, [
        (ENVIRONMENT, environment),
        (SETTING, override({}, settings)),
        (str(path), file),
    ]


def _origin(keys: tuple[str, ...], layers: Iterable[tuple[str, Mapping[str, Any]]]) -> str:
    return next((name for name, document in layers if _holds(document, keys)), DEFAULT)


def _holds(document: Mapping[str, Any], keys: tuple[str, ...]) -> bool:
    """Whether a document gives a value for a key, or for a group around it as a whole."""
    value: Any = document
    for key in keys:
        if not isinstance(value, Mapping):
            return True
        if key not in value:
            return False
        value = value[key]
    return True


def _leaves(
    document: Mapping[str, Any], above: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], Any]]:
    for key, value in document.items():
        if isinstance(value, Mapping) and value:
            yield from _leaves(value, (*above, key))
        else:
            yield (*above, key), value


def _lines(
    document: Mapping[str, Any], above: tuple[str, ...], origins: Mapping[str, str]
) -> Iterator[str]:
    indent = "  " * len(above)
    for key, value in document.items():
        if isinstance(value, Mapping) and value:
            yield f"{indent}{_flow(key)}:"
            yield from _lines(value, (*above, key), origins)
        else:
            line = f"{indent}{_flow(key)}: {_flow(value)}"
            yield f"{line:<{COLUMN}}# {origins['.'.join((*above, key))]}"


def _flow(value: Any) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, width=10**9, allow_unicode=True)
    line = text.removesuffix("...\n").strip()
    return json.dumps(value) if "\n" in line else line

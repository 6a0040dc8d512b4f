"""Resolved configurations, with the source of each value."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from agentflow.app.design.config import config_json, fill_from_environment, load_config
from agentflow.app.design.plan import RunPlan
from agentflow.config.run import apply_settings, load_document

DEFAULT, SETTING, ENVIRONMENT = "default", "--set", "environment"
COLUMN = 52
"""Column of the comments that name the source of each value."""


def resolve_config(path: Path | None, settings: Iterable[str]) -> dict[str, Any]:
    """The configuration of a run: `config`, and `from`: dotted key -> source of its value.

    Args:
        path: The YAML file, if any.
        settings: Strings `a.b=value`.

    Raises:
        UsageError: A key, name or value is wrong.
    """
    given = list(settings)
    plan = RunPlan.of(load_config(path, given, {}))
    config = config_json(plan.config)
    whole, layers = _layers(path, given)
    origins = {
        ".".join(keys): _source(keys, layers) if _sets(whole, keys) else DEFAULT
        for keys, _ in _leaves(config)
    }
    return {"config": config, "from": origins}


def annotated_yaml(found: Mapping[str, Any]) -> str:
    """The result of `resolve_config` as a configuration file with a comment on each source."""
    return "\n".join(_lines(found["config"], (), found["from"]))


def _layers(
    path: Path | None, settings: list[str]
) -> tuple[Mapping[str, Any], list[tuple[str, Mapping[str, Any]]]]:
    """All given values, and the name and document of each source, strongest first."""
    file = load_document(path) if path is not None else {}
    merged = apply_settings(file, settings)
    filled = fill_from_environment(merged, os.environ)
    before = {keys for keys, _ in _leaves(merged)}
    added = [keys for keys, _ in _leaves(filled) if keys not in before]
    environment = {"model": {keys[-1]: True for keys in added}} if added else {}
    return filled, [
        (ENVIRONMENT, environment),
        (SETTING, apply_settings({}, settings)),
        (str(path), file),
    ]


def _source(keys: tuple[str, ...], layers: Iterable[tuple[str, Mapping[str, Any]]]) -> str:
    return next((name for name, document in layers if _sets(document, keys)), DEFAULT)


def _sets(document: Mapping[str, Any], keys: tuple[str, ...]) -> bool:
    """Whether a document sets a key, or a group that contains it."""
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
            yield f"{indent}{_inline_yaml(key)}:"
            yield from _lines(value, (*above, key), origins)
        else:
            line = f"{indent}{_inline_yaml(key)}: {_inline_yaml(value)}"
            yield f"{line:<{COLUMN}}# {origins['.'.join((*above, key))]}"


def _inline_yaml(value: Any) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, width=10**9, allow_unicode=True)
    line = text.removesuffix("...\n").strip()
    return json.dumps(value) if "\n" in line else line

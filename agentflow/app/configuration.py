"""Resolves configurations and names the source of each value."""

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from agentflow.app.design.config import config_json
from agentflow.app.design.plan import RunPlan
from agentflow.config.run import apply_settings, load_document, values_in
from agentflow.models.completion import complete_config, fill_from_environment

DEFAULT, SETTING, ENVIRONMENT = "default", "--set", "environment"
COLUMN = 52
"""Column of the comments that name the source of each value."""


def resolve_config(path: Path | None, settings: Iterable[str]) -> dict[str, Any]:
    """The configuration of a run: `config`, and `from`: dotted key -> source of its value.

    Args:
        path: The YAML file, if any.
        settings: Strings `a.b=value`.
    """
    settings = list(settings)
    file = load_document(path) if path is not None else {}
    from_settings = apply_settings({}, settings)
    merged = apply_settings(file, settings)
    filled = fill_from_environment(merged, os.environ)
    found = complete_config(merged)
    RunPlan.of(found)  # every name exists
    config = config_json(found)

    def source(keys: tuple[str, ...]) -> str:
        if not _sets(filled, keys):
            return DEFAULT
        if not _sets(merged, keys):
            return ENVIRONMENT
        return SETTING if _sets(from_settings, keys) else str(path)

    origins = {".".join(keys): source(keys) for keys, _ in values_in(config)}
    return {"config": config, "from": origins}


def annotated_yaml(found: Mapping[str, Any]) -> str:
    """The result of `resolve_config` as a configuration file with a comment on each source."""
    return "\n".join(_lines(found["config"], (), found["from"]))


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

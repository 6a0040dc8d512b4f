"""Reads YAML strictly, and merges documents."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from agentflow.errors import ConfigError
from agentflow.files.atomic import os_errors

NOT_YAML = (yaml.YAMLError, ValueError, RecursionError)
"""Errors of reading YAML, including impossible dates and deeply nested brackets."""

MOST_VALUES = 1_000_000
"""Most values in a document; far more than anyone writes."""


class _StrictLoader(yaml.SafeLoader):
    """Refuses duplicate keys, which the plain loader silently overwrites."""

    def compose_mapping_node(self, anchor: Any) -> Any:
        node = super().compose_mapping_node(anchor)
        seen = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if (key.tag, key.value) in seen:
                    problem = f"the key {key.value!r} is duplicated"
                    raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
                seen.add((key.tag, key.value))
        return node


def read_yaml(text: str) -> Any:
    """The data in a YAML text.

    Raises:
        NOT_YAML: It is not YAML, has a duplicate key, contains itself, or expands to too many
            values.
    """
    loader = _StrictLoader(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        if _count_values(node, {}) > MOST_VALUES:  # nested aliases could fill the memory
            problem = f"with all aliases expanded it has more than {MOST_VALUES:,} values"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark)
        return loader.construct_object(node, deep=True)
    finally:
        loader.dispose()


def read_yaml_file(path: str | Path, what: str = "") -> Any:
    """The data in a YAML file that a user names.

    Args:
        path: The file.
        what: What it is, for messages: "the level ".

    Raises:
        ConfigError: It cannot be read, or is not YAML.
    """
    with os_errors(f"cannot read {what}{path}", ConfigError):
        content = Path(path).read_bytes()
    try:
        return parse_yaml(content.decode(), path)
    except UnicodeDecodeError:
        raise ConfigError(f"{what}{path} is not UTF-8 text") from None


def parse_yaml(text: str, source: str | Path) -> Any:
    """`read_yaml` of a text from a source, which is named if it is not YAML, as ConfigError."""
    try:
        return read_yaml(text)
    except NOT_YAML as error:
        raise ConfigError(f"{source} is not YAML: {yaml_problem(error)}") from None


def _count_values(node: yaml.Node, known: dict[int, int]) -> int:
    """Number of values, groups and lists in a node, with aliases expanded."""
    if id(node) not in known:
        known[id(node)] = 1  # ends the recursion for a node that contains itself; refused later
        parts = node.value if isinstance(node, yaml.CollectionNode) else []
        pairs = [part if isinstance(part, tuple) else (part,) for part in parts]
        known[id(node)] += sum(_count_values(part, known) for pair in pairs for part in pair)
    return known[id(node)]


def yaml_problem(error: Exception) -> str:
    """Describe a YAML error in one line, with its line number if known."""
    mark = getattr(error, "problem_mark", None)
    why = getattr(error, "problem", None) or str(error).partition("\n")[0]
    return f"line {mark.line + 1}: {why}" if mark else why


def nest_keys(values: Mapping[str, Any]) -> dict[str, Any]:
    """Turn dotted keys into nested mappings: {"wall.height": 2} -> {"wall": {"height": 2}}."""
    tree: dict[str, Any] = {}
    for key, value in values.items():
        branch: Any = value
        for part in reversed(key.split(".")):
            branch = {part: branch}
        tree = deep_merge(tree, branch)
    return tree


def deep_merge(base: Mapping[str, Any], top: Mapping[str, Any]) -> dict[str, Any]:
    """Merge nested mappings; values of `top` win."""
    result = dict(base)
    for key, value in top.items():
        under = result.get(key)
        both = isinstance(under, Mapping) and isinstance(value, Mapping)
        result[key] = deep_merge(under, value) if both else value  # type: ignore[arg-type]
    return result

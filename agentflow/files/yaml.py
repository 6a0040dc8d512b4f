"""Reads YAML strictly, and merges documents."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from agentflow.errors import ConfigError
from agentflow.files.atomic import os_errors

NOT_YAML = (yaml.YAMLError, ValueError)
"""Errors of reading YAML, including impossible dates."""

FAST_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""Both read the same data; libyaml, if installed, is seven times as fast."""

MOST_DEPTH = 100
"""Most groups and lists inside each other; loaders call themselves for each, libyaml's up to a
segmentation fault."""

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
    return load_bounded(text, _StrictLoader)


def load_bounded(text: str, loader: Any) -> Any:
    """The data in a YAML text of bounded depth and size, read with a loader of PyYAML.

    Raises:
        NOT_YAML: It is not YAML, is nested too deeply, contains itself, or expands to too many
            values.
    """
    _require_bounded(text, loader)
    return yaml.load(text, loader)


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


def _require_bounded(text: str, loader: Any) -> None:
    """Refuse a text whose data would exhaust the stack or the memory.

    It looks at the events of the parser, of which there is one after the other, whatever they say.

    Raises:
        YAMLError: It would, or it is not YAML.
    """
    sizes: dict[str | None, int] = {}  # anchor -> values, with aliases expanded
    open_nodes: list[tuple[str | None, int]] = []  # anchor, values before it
    values = 0
    for event in yaml.parse(text, loader):
        problem = ""
        if isinstance(event, yaml.AliasEvent):
            if any(anchor == event.anchor for anchor, _ in open_nodes):
                problem = f"the alias {event.anchor!r} stands inside what it names"
            values += sizes.get(event.anchor, 1)  # an undefined one is refused by the loader
        elif isinstance(event, yaml.CollectionStartEvent):
            open_nodes.append((event.anchor, values))
            values += 1
            if len(open_nodes) > MOST_DEPTH:
                problem = f"more than {MOST_DEPTH} groups and lists are inside each other"
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = open_nodes.pop()
            if anchor is not None:
                sizes[anchor] = values - before
        elif isinstance(event, yaml.ScalarEvent):
            values += 1
            if event.anchor is not None:
                sizes[event.anchor] = 1
        if values > MOST_VALUES:
            problem = f"with all aliases expanded it has more than {MOST_VALUES:,} values"
        if problem:
            mark: Any = event.start_mark  # of either loader
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=mark)


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

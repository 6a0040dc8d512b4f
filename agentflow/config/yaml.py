"""Reads YAML strictly, and puts validation errors in plain words."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import yaml

if TYPE_CHECKING:
    from pydantic import ValidationError
    from pydantic_core import ErrorDetails

NOT_YAML = (yaml.YAMLError, ValueError, RecursionError)
"""Errors of reading YAML, including impossible dates and deeply nested brackets."""

MOST_VALUES = 1_000_000
"""Most values in a document; far more than anyone writes."""

_GROUP, _LIST = "expected a group of keys", "expected a list"
_WHOLE, _NUMBER, _TRUTH = "expected a whole number", "expected a number", "expected true or false"
_PLAIN: Mapping[str, str] = MappingProxyType(
    {
        "missing": "is missing",
        **dict.fromkeys(("dict_type", "mapping_type", "model_type"), _GROUP),
        **dict.fromkeys(("tuple_type", "list_type"), _LIST),
        **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), _WHOLE),
        **dict.fromkeys(("float_type", "float_parsing"), _NUMBER),
        **dict.fromkeys(("bool_type", "bool_parsing"), _TRUTH),
        "finite_number": "expected a finite number",
        "string_type": "expected text",
        "string_too_short": "must not be empty",
        "too_short": "must not be empty",
        "literal_error": "expected {expected}",
        "greater_than_equal": "must be at least {ge}",
        "greater_than": "must be more than {gt}",
        "less_than_equal": "must be at most {le}",
        "less_than": "must be less than {lt}",
    }
)
"""Pydantic's type of an error -> plain words."""


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


def _count_values(node: yaml.Node, known: dict[int, int]) -> int:
    """Number of values, groups and lists in a node, with aliases expanded."""
    if id(node) not in known:
        known[id(node)] = 1  # ends the recursion for a node that contains itself; refused later
        parts = node.value if isinstance(node, yaml.CollectionNode) else []
        pairs = [part if isinstance(part, tuple) else (part,) for part in parts]
        known[id(node)] += sum(_count_values(part, known) for pair in pairs for part in pair)
    return known[id(node)]


def first_fault(error: ValidationError) -> ErrorDetails:
    """An unknown key if there is one, else the first error.

    A misspelt required key is both unknown and missing; the former says more.
    """
    found = error.errors(include_url=False)
    return next((item for item in found if item["type"] == "extra_forbidden"), found[0])


def describe_fault(fault: ErrorDetails) -> str:
    """An error in words, to follow the name of a key: "must be at least 1"."""
    plain = _PLAIN.get(fault["type"])
    if plain is not None:
        return plain.format(**fault.get("ctx", {}))
    message = fault["msg"].removeprefix("Value error, ")
    return message[0].lower() + message[1:]


def find_bool_as_number(
    document: object, validated: object, place: tuple[str, ...] = ()
) -> str | None:
    """The first dotted key where true or false was read as a number; None if there is none.

    Args:
        document: As loaded.
        validated: The validated document as plain data.
        place: Keys leading to both.
    """
    is_number = isinstance(validated, int | float) and not isinstance(validated, bool)
    if isinstance(document, bool) and is_number:
        return ".".join(place)
    pairs: list[tuple[Any, Any, Any]] = []
    if isinstance(document, Mapping) and isinstance(validated, Mapping):
        pairs = [(key, value, validated.get(key)) for key, value in document.items()]
    elif isinstance(document, list | tuple) and isinstance(validated, list | tuple):
        pairs = [(i, *both) for i, both in enumerate(zip(document, validated, strict=False))]
    found = (find_bool_as_number(one, other, (*place, str(key))) for key, one, other in pairs)
    return next((key for key in found if key), None)

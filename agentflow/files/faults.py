"""What is wrong with a document, in plain words."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, get_args

from agentflow.errors import UnknownNameError

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError
    from pydantic_core import ErrorDetails

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


def locate_fault(error: ValidationError, whole: str) -> tuple[str, str]:
    """The dotted key of an error, and the error in words; `whole` stands for the whole document."""
    fault = first_fault(error)
    return ".".join(map(str, fault["loc"])) or whole, describe_fault(fault)


def tell_fault(error: ValueError, whole: str, kind: type[BaseModel] | None = None) -> str:
    """An error of pydantic as "key: words", any other as it is.

    Args:
        error: The error.
        whole: Stands for the whole document.
        kind: What the document is, to list the keys in place of an unknown one.
    """
    from pydantic import ValidationError

    if not isinstance(error, ValidationError):
        return str(error)
    fault = first_fault(error)
    if kind is not None and fault["type"] == "extra_forbidden":
        return _tell_unknown(fault, "key", kind)
    return ": ".join(locate_fault(error, whole))


def explain(error: ValidationError, root: type[BaseModel], key_name: str) -> str:
    """The first error of a document of type `root`; error messages call its keys `key_name`."""
    first = first_fault(error)
    place = [str(part) for part in first["loc"]]
    name = ".".join(place)
    if first["type"] == "extra_forbidden":
        return _tell_unknown(first, key_name, root)
    if first["type"] == "json_invalid":
        return f"the file {describe_fault(first)}"
    if not place:  # a rule about several keys, which names them
        return describe_fault(first)
    if place[-1] == "key_variable":  # do not print it: it may be the key itself
        return f"{name} takes the name of an environment variable, not a key"
    if first["type"] == "missing":
        return f"{name} {describe_fault(first)}"
    if first["type"] == "value_error":  # the message names the value
        return f"{name}: {describe_fault(first)}"
    return f"{name}: {describe_fault(first)}, not {first['input']!r}"


def _tell_unknown(fault: ErrorDetails, key_name: str, kind: type[BaseModel]) -> str:
    """An unknown key, and the valid ones in its place."""
    place = [str(part) for part in fault["loc"]]
    for part in place[:-1]:
        if part in kind.model_fields:  # keys of mappings are not fields
            kind = _model_in(kind.model_fields[part].annotation) or kind
    known = [".".join([*place[:-1], name]) for name in kind.model_fields]
    return str(UnknownNameError(key_name, ".".join(place), known))


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The model in an annotation: alone, optional, or in a list or mapping."""
    from pydantic import BaseModel

    for kind in (annotation, *get_args(annotation)):
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            return kind
    return None


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

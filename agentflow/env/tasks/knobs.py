"""Owns knobs: ranged numbers, their names and ranges, and how values are read and refused.

Which knobs there are is the families'.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, TypeVar

from pydantic import Field, ValidationError
from pydantic.fields import FieldInfo

from agentflow.config.yaml import truth_for_number
from agentflow.env.tasks.base import Parameters
from agentflow.errors import ConfigError

P = TypeVar("P", bound=Parameters)

SHOWN = 6
"""Knobs named to whoever asks for one that is none; the nearest come first."""


def knob(default: float, low: float, high: float, unit: str, help: str) -> Any:
    """A ranged number: its default, bounds (both legal), unit and one line of help."""
    return Field(default, ge=low, le=high, description=help, json_schema_extra={"unit": unit})


@dataclass(frozen=True)
class Knob:
    """One thing about a level that can be set."""

    name: str
    """Dotted, as `--set` takes it."""
    default: Any
    low: float | None
    high: float | None
    unit: str
    help: str

    @property
    def range(self) -> str:
        """Range and unit in words: "0 to 5 m", or what else it may be."""
        if self.low is None or self.high is None:
            return self.unit
        return f"{self.low:g} to {self.high:g} {self.unit}".strip()


def knobs_of(kind: type[Parameters], prefix: str = "") -> Iterator[Knob]:
    """All knobs of a parameter class, depth first, with dotted names."""
    for name, info in kind.model_fields.items():
        inner = info.annotation
        if isinstance(inner, type) and issubclass(inner, Parameters):
            yield from knobs_of(inner, f"{prefix}{name}.")
        else:
            yield _knob_of(prefix + name, info)


def _knob_of(name: str, info: FieldInfo) -> Knob:
    bounds = {
        key: getattr(item, key)
        for item in info.metadata
        for key in ("ge", "le")
        if hasattr(item, key)
    }
    extra = info.json_schema_extra
    unit = str(extra.get("unit", "")) if isinstance(extra, dict) else ""
    default = info.get_default(call_default_factory=True)
    return Knob(name, default, bounds.get("ge"), bounds.get("le"), unit, info.description or "")


def read_knobs(kind: type[P], values: Mapping[str, Any], source: str) -> P:
    """Validate nested values.

    Raises:
        ConfigError: naming the first unknown or out-of-range knob and the legal range.
    """
    try:
        found = kind.model_validate(dict(values))
    except ValidationError as error:
        raise ConfigError(_explain(kind, error, source)) from None
    if name := truth_for_number(values, found.model_dump()):
        raise ConfigError(f"{name} of {source}: expected a number, not true or false")
    return found


def _explain(kind: type[Parameters], error: ValidationError, source: str) -> str:
    first = error.errors(include_url=False)[0]
    name = ".".join(str(part) for part in first["loc"])
    known = {item.name: item for item in knobs_of(kind)}
    found = known.get(name)
    if found is None or first["type"] == "extra_forbidden":
        near = get_close_matches(name, known, n=SHOWN, cutoff=0.5)
        first_ones = [*near, *(item for item in known if item not in near)][:SHOWN]
        shown = ", ".join(f"{item} ({known[item].range})" for item in first_ones)
        rest = ", ..." if len(known) > SHOWN else ""
        return f"unknown knob {name!r} of {source}; known: {shown}{rest}"
    return f"{name} of {source} must be {found.range}, not {first['input']!r}"


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted keys as nested mappings: {"wall.height": 2} -> {"wall": {"height": 2}}."""
    tree: dict[str, Any] = {}
    for key, value in values.items():
        branch: Any = value
        for part in reversed(key.split(".")):
            branch = {part: branch}
        tree = merged(tree, branch)
    return tree


def merged(base: Mapping[str, Any], top: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with the values of `top` laid over it, mapping by mapping."""
    result = dict(base)
    for key, value in top.items():
        under = result.get(key)
        both = isinstance(under, Mapping) and isinstance(value, Mapping)
        result[key] = merged(under, value) if both else value  # type: ignore[arg-type]
    return result

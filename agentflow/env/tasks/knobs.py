"""Knobs: named, range-checked level parameters, how their values are read, and those of
requirements, which every family has."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from math import isfinite
from typing import Any, TypeVar

from pydantic import Field, ValidationError, field_validator
from pydantic.fields import FieldInfo

from agentflow.env.tasks.base import Parameters
from agentflow.errors import ConfigError
from agentflow.files.faults import find_bool_as_number
from agentflow.machine import requirements
from agentflow.machine.blocks.library import library

P = TypeVar("P", bound=Parameters)

SUGGESTIONS = 6
"""Most knobs that an error message suggests; the closest names come first."""


def knob(default: float, low: float, high: float, unit: str, help: str) -> Any:
    """A number with a default, inclusive bounds, a unit and one line of help."""
    return Field(default, ge=low, le=high, description=help, json_schema_extra={"unit": unit})


def choice(default: object, values: str, help: str) -> Any:
    """A knob that is not a number: its default, its possible values and one line of help."""
    return Field(default, description=help, json_schema_extra={"unit": values})


@dataclass(frozen=True)
class Knob:
    """A level parameter that users can set; its name is dotted, as in `--set`."""

    name: str
    default: Any
    low: float | None
    high: float | None
    unit: str
    help: str

    @property
    def range(self) -> str:
        """Range and unit ("0 to 5 m"), or the allowed values."""
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
        ConfigError: A knob is unknown or out of range; the message names it and its range.
    """
    try:
        knobs = kind.model_validate(dict(values))
    except ValidationError as error:
        raise ConfigError(_explain(kind, error, source)) from None
    if name := find_bool_as_number(values, knobs.model_dump()):
        raise ConfigError(f"{name} of {source}: expected a number, not true or false")
    return knobs


def _explain(kind: type[Parameters], error: ValidationError, source: str) -> str:
    first = error.errors(include_url=False)[0]
    name = ".".join(str(part) for part in first["loc"])
    if first["type"] == "value_error":
        return f"{name or 'knobs'} of {source}: {first['ctx']['error']}"
    known = {item.name: item for item in knobs_of(kind)}
    found = known.get(name) or known.get(".".join(map(str, first["loc"][:2])))  # a key of a mapping
    if found is None or first["type"] == "extra_forbidden":
        near = get_close_matches(name, known, n=SUGGESTIONS, cutoff=0.5)
        names = [*near, *(item for item in known if item not in near)][:SUGGESTIONS]
        listed = ", ".join(f"{item} ({known[item].range})" for item in names)
        rest = ", ..." if len(known) > SUGGESTIONS else ""
        return f"unknown knob {name!r} of {source}; known: {listed}{rest}"
    return f"{name} of {source} must be {found.range}, not {first['input']!r}"


class RequirementKnobs(Parameters):
    """What machines must keep besides the task, such as a greatest mass."""

    wanted: tuple[str, ...] = choice(
        (),
        "a list such as mass <= 60 kg, safety >= 1.5",
        "requirements, each a quantity, a relation and a value",
    )
    mode: requirements.Mode = choice(
        "must",
        "must or report",
        "must: the score counts only if all are met; report: they are only told",
    )
    prices: tuple[tuple[int, float], ...] = choice(
        (), "block type: credits", "prices that differ from the usual ones"
    )

    @field_validator("wanted", mode="before")
    @classmethod
    def _read(cls, value: Any) -> Any:
        """Requirements as they are written best, in a list; text may hold several."""
        listed = value.split(",") if isinstance(value, str) else value
        if not isinstance(listed, list | tuple):
            return value
        items = [requirements.Requirement.parse(str(item)) for item in listed]
        if fault := requirements.contradiction(items):
            raise ValueError(fault)
        return tuple(dict.fromkeys(map(str, items)))

    @field_validator("prices", mode="before")
    @classmethod
    def _pair(cls, value: Any) -> Any:
        """Pairs of a mapping, as knobs are hashed."""
        return tuple(value.items()) if isinstance(value, Mapping) else value

    @field_validator("prices")
    @classmethod
    def _check(cls, prices: tuple[tuple[int, float], ...]) -> tuple[tuple[int, float], ...]:
        for kind, price in prices:
            if kind not in library():
                raise ValueError(f"{kind} is not a block type; see: agentflow blocks")
            if not (isfinite(price) and price >= 0):
                raise ValueError(
                    f"the price of {library()[kind].label} is {price:g} credits; it must not be "
                    "negative"
                )
        return prices

    @property
    def all(self) -> requirements.Requirements:
        """The requirements with all prices."""
        if not self.wanted:
            return requirements.NONE
        items = tuple(map(requirements.Requirement.parse, self.wanted))
        return requirements.Requirements(
            items, self.mode, {**requirements.usual_prices(), **dict(self.prices)}
        )

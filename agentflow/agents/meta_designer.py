"""The meta-designer: plans a machine as a blueprint of structures in build order."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from agentflow.agents.base import Parsed, Role
from agentflow.agents.context import ROOT_TYPE, Elsewhere, task_context
from agentflow.llm.procedural.designing import plan
from agentflow.llm.procedural.reading import Script
from agentflow.machine.brief import Brief
from agentflow.machine.formats.json_text import iter_json
from agentflow.machine.tree import Machine

MAX_TYPES = 3
"""Maximum number of block types per structure, not counting the root."""
_KEYS = ("definition", "function_points", "design_structure", "build_order", "machine_structure")


@dataclass(frozen=True)
class MetaDesignerInput:
    """A task to plan for."""

    brief: Brief
    detailed: bool = False
    """Whether the guidance should describe the construction step by step."""
    elsewhere: Elsewhere = field(default_factory=Elsewhere)


@dataclass(frozen=True)
class Structure:
    """One functional part of a machine, in the model's words."""

    name: str
    description: str
    function_points: tuple[str, ...]
    """Function points of the blueprint that it serves."""
    types: tuple[int, ...]
    """Block types that it may use, ascending, without the root."""
    guidance: str


@dataclass(frozen=True)
class Blueprint:
    """A plan: one or more structures in build order."""

    definition: str
    function_points: tuple[str, ...]
    structures: tuple[Structure, ...]

    def find(self, name: str) -> Structure:
        """The structure of this name; raises KeyError if there is none."""
        return {structure.name: structure for structure in self.structures}[name]

    def to_json(self) -> dict[str, Any]:
        """The blueprint in the notation that models read and write."""
        return {
            "definition": self.definition,
            "function_points": list(self.function_points),
            "design_structure": [
                {
                    "function_name": structure.name,
                    "description": structure.description,
                    "related_function_points": list(structure.function_points),
                }
                for structure in self.structures
            ],
            "build_order": [structure.name for structure in self.structures],
            "machine_structure": {
                structure.name: {"type": list(structure.types), "guidance": structure.guidance}
                for structure in self.structures
            },
        }


class MetaDesigner(Role[MetaDesignerInput, Blueprint]):
    """Splits a machine into structures, each with its block types and guidance."""

    name: ClassVar[str] = "meta_designer"
    stage: ClassVar[str] = "initial"
    sees: ClassVar[bool] = True
    tokens: ClassVar[tuple[int, int]] = (1250, 670)
    labels: ClassVar[tuple[str, ...]] = ("Plan", "Hypothesize")
    script: ClassVar[Script] = Script(plan, "machine_structure", needs_machine=False)

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> MetaDesignerInput:  # noqa: ARG003
        return MetaDesignerInput(brief)

    def variables(self, given: MetaDesignerInput) -> Mapping[str, object]:
        known = given.elsewhere.context()
        return {**task_context(given.brief), "detailed": given.detailed, **known}

    def parse(self, text: str, given: MetaDesignerInput) -> Parsed[Blueprint]:
        """Read the last JSON object of the reply that is a blueprint."""
        data, repaired = _object_in(text)
        if data is None:
            return Parsed(None, _NO_OBJECT, "unparsable", parsed=False)
        try:
            return Parsed(read_blueprint(data, given.brief), repaired=repaired)
        except _Refused as refused:
            code, problem = refused.args
            return Parsed(None, problem, code, repaired)


def read_blueprint(data: Mapping[str, Any], brief: Brief) -> Blueprint:
    """Turn decoded JSON into a blueprint; raises `_Refused` for the first problem."""
    missing = [key for key in _KEYS if key not in data]
    if missing:
        raise _Refused("missing_key", f"The blueprint lacks the key {', '.join(missing)}.")
    parts, names = _structures(data), _build_order(data)
    descriptions = _descriptions(data["design_structure"])
    structures = []
    for name in names:
        if _key(name) not in parts:
            known = ", ".join(str(part) for part in data["machine_structure"])
            raise _Refused(
                "undefined_structure",
                f"build_order names {name!r}, which machine_structure does not define; "
                f"it defines: {known}.",
            )
        structures.append(_structure(name, parts[_key(name)], descriptions, brief))
    _check_complete(structures, parts, brief)
    points = _strings(data["function_points"])
    return Blueprint(_text(data["definition"]), points, tuple(structures))


_NO_OBJECT = (
    "The reply contains no blueprint: expected one JSON object in a ```json fence with the keys "
    + ", ".join(_KEYS)
    + "."
)


class _Refused(Exception):
    """An unusable blueprint; its arguments are the code and the problem to send to the model."""


def _object_in(text: str) -> tuple[dict[str, Any] | None, bool]:
    """The first object in a text that looks like a blueprint, else any; whether it was repaired."""
    other: tuple[dict[str, Any] | None, bool] = (None, False)
    for value, repaired in iter_json(text, dict):
        if "machine_structure" in value:
            return value, repaired
        if other[0] is None:
            other = value, repaired
    return other


def _structures(data: Mapping[str, Any]) -> dict[str, Any]:
    parts = data["machine_structure"]
    if not isinstance(parts, dict) or not parts:
        raise _Refused(
            "no_structure",
            "machine_structure must map at least one structure name to its type and guidance.",
        )
    return {_key(str(name)): part for name, part in parts.items()}


def _build_order(data: Mapping[str, Any]) -> tuple[str, ...]:
    names = _strings(data["build_order"])
    if not names:
        raise _Refused("no_structure", "build_order must list at least one structure name.")
    keys = [_key(name) for name in names]
    for name, key in zip(names, keys, strict=True):
        if keys.count(key) > 1:
            raise _Refused("repeated_structure", f"build_order names {name!r} more than once.")
    return names


def _structure(
    name: str, part: object, descriptions: Mapping[str, Mapping[str, Any]], brief: Brief
) -> Structure:
    if not isinstance(part, dict):
        raise _Refused(
            "bad_structure", f"Structure {name!r} must be an object with type and guidance."
        )
    types = _types(name, part.get("type", part.get("block_id")), brief.blocks)
    described = descriptions.get(_key(name), {})
    return Structure(
        name=name,
        description=_text(described.get("description", "")),
        function_points=_strings(described.get("related_function_points", ())),
        types=types,
        guidance=_text(part.get("guidance", "")),
    )


def _types(name: str, value: object, allowed: Collection[int]) -> tuple[int, ...]:
    items = value if isinstance(value, list) else [value]
    numbers = [_integer(item) for item in items]
    types = sorted({number for number in numbers if number not in (None, ROOT_TYPE)})
    if None in numbers or (not types and ROOT_TYPE not in numbers):
        raise _Refused(
            "bad_types",
            f"Structure {name!r} needs `type`: a list of one to {MAX_TYPES} block type ids.",
        )
    foreign = [str(kind) for kind in types if kind not in allowed]
    if foreign:
        raise _Refused(
            "type_not_allowed",
            f"Structure {name!r} uses type {', '.join(foreign)}, which this task does not allow; "
            f"allowed: {', '.join(map(str, sorted(allowed)))}.",
        )
    if len(types) > MAX_TYPES:
        raise _Refused(
            "too_many_types",
            f"Structure {name!r} lists {len(types)} block types; at most {MAX_TYPES} each. "
            "Drop some or split the structure.",
        )
    return tuple(types)


def _check_complete(structures: list[Structure], parts: Mapping[str, Any], brief: Brief) -> None:
    built = {_key(structure.name) for structure in structures}
    left = [name for name in parts if name not in built]
    if left:
        raise _Refused(
            "not_in_build_order", f"build_order leaves out the structure {', '.join(left)}."
        )
    used = {kind for structure in structures for kind in structure.types}
    for kind, count in sorted(brief.required.items()):
        if count and kind not in used and kind != ROOT_TYPE:
            raise _Refused(
                "required_missing",
                f"A complete machine must have {count} of type {kind}, "
                "but no structure lists this type.",
            )


def _descriptions(value: object) -> dict[str, Mapping[str, Any]]:
    items = value if isinstance(value, list) else []
    return {
        _key(str(item.get("function_name", ""))): item for item in items if isinstance(item, dict)
    }


def _strings(value: object) -> tuple[str, ...]:
    """A list of strings or a single one as a tuple, without empty ones."""
    items = value if isinstance(value, list | tuple) else [value]
    return tuple(text for item in items if (text := _text(item)))


def _text(value: object) -> str:
    return "" if value is None else str(value).strip()


def _key(name: str) -> str:
    """A name for comparison: case, spaces and underscores make no difference."""
    return " ".join(name.replace("_", " ").split()).casefold()


def _integer(value: object) -> int | None:
    if isinstance(value, str) and value.strip().isdecimal() and len(value.strip()) < 5:
        return int(value)
    return value if isinstance(value, int) and not isinstance(value, bool) else None

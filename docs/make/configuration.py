"""The page on configuration: every key of runs, sweeps and training, from their models."""

from __future__ import annotations

import inspect
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt, MinLen
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from agentflow.config.run import DesignConfig
from agentflow.config.sweep import SweepConfig
from agentflow.docstrings import split_docstring
from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.registry import ENGINES
from agentflow.prompts.registry import PROMPT_SETS
from agentflow.search.registry import STRATEGIES
from agentflow.training.advantages import ADVANTAGES
from agentflow.training.config import SftConfig
from agentflow.training.grpo.config import GrpoConfig
from agentflow.workflows.registry import WORKFLOWS
from docs.make.markdown import anchor, blocks, code, generated, sentence, table

ABOUT = (
    "A configuration is a YAML file. Groups are nested keys; this page writes them with dots, as "
    "`--set` takes them: `--set model.sampling.temperature=0.2`. Files take "
    "dotted keys too, and both take keys of `settings` without that prefix: `search.rounds`. Quote "
    "values with brackets: `--set 'blocks.without=[9]'`. An unknown key or a value out of range is "
    "an error."
)
REGISTERED: Mapping[str, tuple[str, ...]] = {
    "workflow": WORKFLOWS.ours,
    "engine": (AUTO, *ENGINES.ours),
    "prompts": PROMPT_SETS.ours,
    "settings.search.strategy": STRATEGIES.ours,
    "advantage.name": tuple(ADVANTAGES),
}
"""Keys that name a registered part; other distributions can add further names."""
PLAIN = {int: "integer", float: "number", str: "text", bool: "true or false", Any: "anything"}
BOUNDS = {Ge: "at least", Gt: "more than", Le: "at most", Lt: "less than"}
EXTREME = 2**32
"""Bounds from here on only keep a number within its type; they are left out."""


@dataclass(frozen=True)
class Part:
    """A kind of file."""

    title: str
    about: str
    model: type[BaseModel]


PARTS = (
    Part(
        "Runs",
        "`agentflow design --config FILE`, and the key `base` of a sweep. `agentflow config show` "
        "prints a configuration with the source of each value.",
        DesignConfig,
    ),
    Part(
        "Sweeps and benchmarks",
        "`agentflow sweep FILE`. A benchmark is a sweep with the key `benchmark`.",
        SweepConfig,
    ),
    Part("Fine-tuning", "`agentflow train sft --config FILE`.", SftConfig),
    Part("Reinforcement learning", "`agentflow train grpo --config FILE`.", GrpoConfig),
)


@dataclass(frozen=True)
class Group:
    """Keys that are nested below one dotted name; "" is the top of a file."""

    part: Part
    prefix: str
    model: type[BaseModel]

    @property
    def heading(self) -> str:
        """The heading of its table."""
        return f"{self.part.title}: `{self.prefix}.*`"

    def below(self, name: str, field: FieldInfo) -> Group | None:
        """The group that a key holds; None if it holds a value."""
        model, further = _inner_model(field.annotation)
        path = ".".join(filter(None, (self.prefix, name, further)))
        return None if model is None else Group(self.part, path, model)


Listed = dict[type[BaseModel], Group]
"""Where the keys of each model are listed: a model that occurs again has the same keys."""


def page() -> str:
    """The whole page."""
    listed: Listed = {}
    for part in PARTS:
        groups = _groups(Group(part, "", part.model))
        for group in sorted(groups, key=lambda group: group.prefix.count(".")):
            listed.setdefault(group.model, group)
    sections = [_part(part, listed) for part in PARTS]
    return blocks(generated("Configuration", ABOUT), *sections) + "\n"


def _part(part: Part, listed: Listed) -> str:
    top, *groups = _groups(Group(part, "", part.model))
    sections = [
        blocks(f"### {group.heading}", _summary(group.model), _keys(group, listed))
        for group in groups
        if listed[group.model] == group
    ]
    return blocks(f"## {part.title}", part.about, _keys(top, listed), *sections)


def _groups(group: Group) -> Iterator[Group]:
    """A group and every group within it, outer ones first."""
    yield group
    for name, field in group.model.model_fields.items():
        inner = group.below(name, field)
        if inner is not None:
            yield from _groups(inner)


def _summary(model: type[BaseModel]) -> str:
    return sentence((model.__doc__ or "").split("\n\n")[0])


def _inner_model(kind: Any) -> tuple[type[BaseModel] | None, str]:
    """The model that a field holds, and the name that keys have below it; None if it has none."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return kind, ""
    if get_origin(kind) is dict:
        return _inner_model(get_args(kind)[1])[0], "NAME"
    if get_origin(kind) is tuple:
        return _inner_model(get_args(kind)[0])[0], "N"
    if get_origin(kind) in (Union, types.UnionType):
        return next(filter(lambda found: found[0], map(_inner_model, get_args(kind))), (None, ""))
    return None, ""


def _keys(group: Group, listed: Listed) -> str:
    rows, texts = [], meanings(group.model)
    for name, field in group.model.model_fields.items():
        key = f"{group.prefix}.{name}" if group.prefix else name
        limits = _limits(field)
        kind = _kind(key, field.annotation) + (f", {limits}" if limits else "")
        inner = group.below(name, field)
        meaning = _meaning(key, texts.get(name, ""), inner)
        if inner is not None:
            meaning += _pointer(inner, listed[inner.model])
        rows.append((code(key), kind, _default(field), meaning))
    return table(("key", "type", "default", "meaning"), rows)


def _pointer(group: Group, listed: Group) -> str:
    """Where the keys of a group are listed."""
    words = "Keys:" if group == listed else "The same keys as"
    return f" {words} [`{listed.prefix}`](#{anchor(listed.heading)})."


def meanings(model: type[BaseModel]) -> dict[str, str]:
    """What the docstrings of a model and of its bases say of its fields, under `Attributes:`."""
    found: dict[str, str] = {}
    for kind in reversed(model.__mro__):
        if kind not in BaseModel.__mro__:
            found |= split_docstring(inspect.cleandoc(kind.__doc__ or ""))[1]
    return found


def _meaning(key: str, text: str, inner: Group | None) -> str:
    if text:  # YAML writes null for None
        return sentence(text.replace("None", "`null`"))
    if inner is None:
        raise ValueError(f"the configuration key {key} has no text: add it to its docstring")
    return _summary(inner.model)


def _kind(key: str, kind: Any) -> str:
    """A type in words; choices where there are some."""
    if key in REGISTERED and kind is str:
        return ", ".join(map(code, REGISTERED[key]))
    origin, inside = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _kind("", inside[0])
    if origin is Literal:
        return ", ".join(code(str(choice)) for choice in inside)
    if origin in (Union, types.UnionType):
        return " or ".join(_kind("", item) for item in inside if item is not type(None))
    if origin is tuple or origin is list:
        return f"list of {_kind('', inside[0])}"
    if origin in (dict, Mapping):
        return f"mapping of {_kind('', inside[0])} to {_kind('', inside[1])}"
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return "group"
    return PLAIN[kind]


def _limits(field: FieldInfo) -> str:
    words = []
    for item in field.metadata:
        if isinstance(item, MinLen):
            words.append("not empty")
        for bound, phrase in BOUNDS.items():
            value = getattr(item, bound.__name__.lower(), None)
            if isinstance(item, bound) and value is not None and abs(value) < EXTREME:
                words.append(f"{phrase} {value:g}")
    return ", ".join(words)


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    if value is None or isinstance(value, BaseModel) or value in ("", (), {}):
        return ""
    if isinstance(value, bool):
        return code(str(value).lower())
    if isinstance(value, tuple):
        return code(f"[{', '.join(map(str, value))}]")
    return code(f"{value:.6g}" if isinstance(value, float) else str(value))

"""The configuration of a run, read from YAML files and dotted settings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from agentflow.config.yaml import (
    NOT_YAML,
    describe_fault,
    find_bool_as_number,
    first_fault,
    read_yaml,
)
from agentflow.errors import ConfigError, UnknownNameError, yaml_problem
from agentflow.llm.messages import Sampling
from agentflow.llm.settings import EndpointSettings
from agentflow.llm.wrappers.budget import BudgetSettings
from agentflow.llm.wrappers.prices import Price
from agentflow.workflows.settings import WorkflowSettings

PROCEDURAL = "procedural"
"""The built-in model: rules and random choices, no language model, no endpoint."""
KEY_VARIABLE = "OPENAI_API_KEY"
_VARIABLE = r"^[A-Za-z_][A-Za-z0-9_]*$"


class RoleModel(BaseModel):
    """The model of one role, in place of the run's model."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(min_length=1, description="model name at the endpoint")
    base_url: str | None = Field(
        None, min_length=1, description="None is the run's endpoint, with its key"
    )
    key_variable: str | None = Field(
        None,
        pattern=_VARIABLE,
        description="environment variable of the key; None with a base_url sends no key",
    )
    sampling: Sampling | None = Field(None, description="None is the run's")


class ModelConfig(BaseModel):
    """Models, sampling and limits. Keys come from the environment only."""

    model_config = ConfigDict(frozen=True, extra="forbid", protected_namespaces=())

    name: str = Field(
        PROCEDURAL, min_length=1, description="model name at the endpoint, or a model's folder"
    )
    label: str | None = Field(
        None, min_length=1, description="name in results of a model in a folder, which tells it"
    )
    base_url: str | None = Field(None, min_length=1, description="URL before /chat/completions")
    key_variable: str = Field(
        KEY_VARIABLE, pattern=_VARIABLE, description="environment variable of the key"
    )
    roles: dict[str, RoleModel] = Field({}, description="roles with another model")
    prices: dict[str, Price] = Field(
        {}, description="model name: input, output and cached, per million tokens"
    )
    sampling: Sampling = Field(Sampling(), description="temperature, top_p, max_tokens ...")
    endpoint: EndpointSettings = Field(
        EndpointSettings(), description="time limits, retries, rate limits"
    )
    budget: BudgetSettings = Field(
        BudgetSettings(), description="limits on calls, tokens and money"
    )

    @property
    def local(self) -> bool:
        """Whether the model answers in this process: no endpoint, no key, no cost."""
        return self.name == PROCEDURAL or self.label is not None


class DesignConfig(BaseModel):
    """Everything that, together with the replies, decides the result of a run."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    task: str = Field("throwing", description="level, for instance throwing or throwing/3")
    knobs: dict[str, Any] = Field({}, description="changed knobs of the level")
    workflow: str = Field("hierarchical", description="procedure from task to machine")
    engine: str = Field("auto", description="physics engine; auto is the first that is installed")
    seed: int = Field(0, ge=-(2**63), lt=2**63, description="random seed")
    model: ModelConfig = ModelConfig()
    prompts: str = Field("default", description="prompt set")
    rationale_from: str | None = Field(
        None,
        description="run whose designers' rationales to follow; read once, then stored in settings",
    )
    max_retry: int = Field(
        5, ge=1, description="attempts per request; refiners in a search and placers have one"
    )
    settings: WorkflowSettings = Field(WorkflowSettings(), description="settings of the workflow")
    verify: bool = Field(
        True, description="simulate the best machine again under small variations of physics"
    )
    keep_rollouts: Literal["winners", "all"] = Field(
        "winners", description="rollouts to save: of each stage's best machine, or all"
    )
    workers: int = Field(
        2, ge=1, le=4096, description="processes for rollouts; does not affect results"
    )


def load_document(path: Path) -> dict[str, Any]:
    """Read a configuration file, or the configuration in a run.yaml, without validating it.

    Raises:
        ConfigError: The file cannot be read or is not a YAML mapping.
    """
    try:
        document = read_yaml(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror}") from None
    except NOT_YAML as error:
        raise ConfigError(f"{path} is not YAML: {yaml_problem(error)}") from None
    if not isinstance(document, dict):
        raise ConfigError(f"{path} must hold a mapping of configuration keys")
    config = document.get("config")
    return config if "schema" in document and isinstance(config, dict) else document


def apply_settings(document: Mapping[str, Any], settings: Iterable[str]) -> dict[str, Any]:
    """Apply `a.b=value` settings to a document; see `split_setting` and `set_key`."""
    result = dict(document)
    for setting in settings:
        result = set_key(result, *split_setting(setting))
    return result


def split_setting(setting: str) -> tuple[str, Any]:
    """Name and value of an `a.b=value` setting; the value is read as YAML.

    Raises:
        ConfigError: It has no `=`, or the value is not YAML.
    """
    path, equals, text = setting.partition("=")
    if not equals or not path:
        raise ConfigError(f"--set takes name=value, not {setting!r}")
    try:
        return path.strip(), read_yaml(text)
    except NOT_YAML as error:
        why = yaml_problem(error)
        raise ConfigError(f"--set {path}: {text!r} is not a YAML value: {why}") from None


def set_key(document: Mapping[str, Any], path: str, value: Any) -> dict[str, Any]:
    """The document with one key set.

    A path that begins with a key of `DesignConfig` or of its `settings` sets that key; any other
    path is a knob of the task.

    Raises:
        ConfigError: The path runs through a plain value.
    """
    result = group = dict(document)
    *groups, last = _keys_of(path)
    plain = _plain_keys(DesignConfig)
    for depth, key in enumerate(groups, start=1):
        below = group.get(key, {})
        if not isinstance(below, Mapping) or ".".join(groups[:depth]) in plain:
            raise ConfigError(f"--set {path}: {key} is a single value, not a group of keys")
        group[key] = dict(below)
        group = group[key]
    group[last] = value
    return result


def suggest_key(knobs: Iterable[str]) -> str:
    """A hint for unknown knobs that look like a configuration key; "" if none does.

    `rounds` also matches `search.rounds`.
    """
    keys = [key.removeprefix("settings.") for key in _keys_in(DesignConfig)]
    for knob in knobs:
        parts = knob.count(".") + 1
        ends = {".".join(key.split(".")[-parts:]): key for key in reversed(keys)}
        near = get_close_matches(knob, ends, n=1, cutoff=0.75)
        if near:
            return f"; did you mean the configuration key {ends[near[0]]!r}?"
    return ""


def _keys_in(kind: type[BaseModel], above: str = "") -> Iterator[str]:
    """Every dotted key; a group of keys precedes its members."""
    for name, field in kind.model_fields.items():
        yield above + name
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            yield from _keys_in(inner, f"{above}{name}.")


@cache
def _plain_keys(kind: type[BaseModel], above: str = "") -> frozenset[str]:
    """Every dotted key that holds one value: neither a group of keys nor a mapping."""
    found = set[str]()
    for name, field in kind.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            found |= _plain_keys(inner, f"{above}{name}.")
        elif get_origin(inner) is not dict:
            found.add(above + name)
    return frozenset(found)


def build_config(document: object) -> DesignConfig:
    """Validate a document.

    Raises:
        ConfigError: A key is wrong; the message names it, its value, and what was expected.
    """
    if not isinstance(document, Mapping):
        raise ConfigError("the configuration must be a mapping of keys")
    try:
        found = DesignConfig.model_validate(dict(document))
    except ValidationError as error:
        raise ConfigError(explain(error, DesignConfig, "configuration key")) from None
    if key := find_bool_as_number(document, found.model_dump()):
        raise ConfigError(f"{key}: expected a number, not true or false")
    return found


def _keys_of(path: str) -> tuple[str, ...]:
    first, *rest = path.split(".")
    if first in DesignConfig.model_fields:
        if first == "knobs" and rest:
            return ("knobs", ".".join(rest))
        return (first, *rest)
    if first in WorkflowSettings.model_fields:
        return ("settings", first, *rest)
    return ("knobs", path)


def explain(error: ValidationError, root: type[BaseModel], key_name: str) -> str:
    """The first error of a document of type `root`; error messages call its keys `key_name`."""
    first = first_fault(error)
    place = [str(part) for part in first["loc"]]
    name = ".".join(place)
    if first["type"] == "extra_forbidden":
        return str(UnknownNameError(key_name, name, _names_beside(place, root)))
    if not place:  # a rule about several keys, which names them
        return describe_fault(first)
    if place[-1] == "key_variable":  # do not print it: it may be the key itself
        return f"{name} takes the name of an environment variable, not a key"
    if first["type"] == "missing":
        return f"{name} {describe_fault(first)}"
    if first["type"] == "value_error":  # the message names the value
        return f"{name}: {describe_fault(first)}"
    return f"{name}: {describe_fault(first)}, not {first['input']!r}"


def _names_beside(place: list[str], kind: type[BaseModel]) -> list[str]:
    """The valid keys in place of an unknown one."""
    for part in place[:-1]:
        if part in kind.model_fields:  # keys of mappings are not fields
            kind = _model_in(kind.model_fields[part].annotation) or kind
    return [".".join([*place[:-1], name]) for name in kind.model_fields]


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The model in an annotation: alone, optional, or in a list or mapping."""
    for kind in (annotation, *get_args(annotation)):
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            return kind
    return None

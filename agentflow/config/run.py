"""The configuration of a run, read from YAML files and dotted settings."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_origin

from pydantic import BaseModel, Field, ValidationError

from agentflow.config.renamed import KEYS, update_names, warn_of_names
from agentflow.config.shipped import find_config
from agentflow.errors import ConfigError
from agentflow.files.faults import explain, find_bool_as_number
from agentflow.files.yaml import NOT_YAML, read_yaml, read_yaml_file, yaml_problem
from agentflow.llm.messages import Sampling
from agentflow.llm.settings import EndpointSettings
from agentflow.llm.wrappers.budget import BudgetSettings, Price
from agentflow.workflows.settings import WorkflowSettings

PROCEDURAL = "procedural"
"""The built-in model: rules and random choices, no language model, no endpoint."""
KEY_VARIABLE = "OPENAI_API_KEY"
_VARIABLE = r"^[A-Za-z_][A-Za-z0-9_]*$"
_LISTED = frozenset(
    {
        *("task", "workflow", "engine", "seed", "workers", "keep_rollouts"),
        *("model.name", "model.label", "model.base_url", "model.key_variable"),
    }
)
"""Keys that lists of runs name in columns of their own, or that change no result."""
_WIDE = 40
"""Most characters of a value in `differing_text`."""


class RoleModel(BaseModel, frozen=True, extra="forbid"):
    """The model of one role, in place of the run's model.

    Attributes:
        name: Model name at the endpoint.
        base_url: None is the run's endpoint, with its key.
        key_variable: Environment variable of the key; None with a base_url sends no key.
        sampling: None is the run's.
    """

    name: str = Field(min_length=1)
    base_url: str | None = Field(None, min_length=1)
    key_variable: str | None = Field(None, pattern=_VARIABLE)
    sampling: Sampling | None = None


class ModelConfig(BaseModel, frozen=True, extra="forbid", protected_namespaces=()):
    """Models, sampling and limits. API keys come from the environment only.

    Attributes:
        name: Model name at the endpoint, or a model's folder.
        label: Name in results, for a model in a folder; read from the folder.
        base_url: URL before /chat/completions.
        key_variable: Environment variable of the key.
        roles: Roles with another model.
        prices: Model name: input, output and cached, per million tokens.
        sampling: Temperature, top_p, max_tokens ...
        endpoint: Time limits, retries, rate limits.
        budget: Limits on calls, tokens and money.
    """

    name: str = Field(PROCEDURAL, min_length=1)
    label: str | None = Field(None, min_length=1)
    base_url: str | None = Field(None, min_length=1)
    key_variable: str = Field(KEY_VARIABLE, pattern=_VARIABLE)
    roles: dict[str, RoleModel] = {}
    prices: dict[str, Price] = {}
    sampling: Sampling = Sampling()
    endpoint: EndpointSettings = EndpointSettings()
    budget: BudgetSettings = BudgetSettings()

    @property
    def local(self) -> bool:
        """Whether the model answers in this process: no endpoint, no key, no cost."""
        return self.name == PROCEDURAL or self.label is not None


class DesignConfig(BaseModel, frozen=True, extra="forbid"):
    """Everything that, together with the replies, decides the result of a run.

    Attributes:
        task: Level, for instance throwing or throwing/3.
        knobs: Changed knobs of the level.
        workflow: Procedure from task to machine.
        engine: Physics engine; auto is the first that is installed.
        seed: Random seed.
        prompts: Prompt set, or a folder of prompts: ./mine.
        rationale_from: Run whose designers' rationales to follow; read once, then stored in
            settings.
        max_retry: Attempts per request; refiners in a search and placers have one.
        settings: Settings of the workflow.
        verify: Simulate the best machine again under small variations of physics.
        keep_rollouts: Rollouts to save: of each stage's best machine, or all.
        workers: Processes for rollouts; does not affect results.
    """

    task: str = "throwing"
    knobs: dict[str, Any] = {}
    workflow: str = "hierarchical"
    engine: str = "auto"
    seed: int = Field(0, ge=-(2**63), lt=2**63)
    model: ModelConfig = ModelConfig()
    prompts: str = "default"
    rationale_from: str | None = None
    max_retry: int = Field(5, ge=1)
    settings: WorkflowSettings = WorkflowSettings()
    verify: bool = True
    keep_rollouts: Literal["best", "all"] = "best"
    workers: int = Field(2, ge=1, le=4096)


def load_mapping(path: Path) -> dict[str, Any]:
    """Read a YAML file of keys, or the configuration in a run.yaml, as it is written.

    Those that ship with the package are found from any folder; see `find_config`.

    Raises:
        ConfigError: The file cannot be read or is not a YAML mapping.
    """
    return _read_mapping(path)[0]


def load_document(path: Path) -> dict[str, Any]:
    """`load_mapping` of a configuration or a sweep, with its keys as `spell_out` writes them."""
    document, by_a_program = _read_mapping(path)
    if by_a_program:
        return document
    if isinstance(base := document.get("base"), dict):  # of a sweep
        document = {**document, "base": spell_out(base)}
        warn_of_names(document["base"])
    document = spell_out(document)
    warn_of_names(document)
    return document


def _read_mapping(path: Path) -> tuple[dict[str, Any], bool]:
    """The keys in a file, and whether it is a run.yaml, which no person wrote."""
    document = read_yaml_file(find_config(path))
    if not isinstance(document, dict):
        raise ConfigError(f"{path} must hold a mapping of configuration keys")
    config = document.get("config")
    if "schema" in document and isinstance(config, dict):
        return config, True
    return document, False


def spell_out(document: Mapping[str, Any]) -> dict[str, Any]:
    """The document with short and dotted keys in their groups, as `--set` takes them.

    `trajectories` is `settings.trajectories`. Keys that belong nowhere stay as they are.

    Raises:
        ConfigError: A key is given twice, short and in full.
    """
    result: dict[str, Any] = {}
    for key, value in document.items():
        keys = _keys_of(str(key)) if key not in DesignConfig.model_fields else (key,)
        _put(result, (key,) if keys[0] == "knobs" and key != "knobs" else keys, value)
    return result


def _put(group: dict[str, Any], keys: Sequence[str], value: Any, above: str = "") -> None:
    """Set a value in nested groups, which are made or added to; nothing is replaced."""
    first, *rest = keys
    path = f"{above}{first}"
    if rest:
        inner = group.setdefault(first, {})
        if not isinstance(inner, dict):
            raise ConfigError(f"{path} is a single value, not a group of keys")
        _put(inner, rest, value, f"{path}.")
    elif isinstance(value, Mapping) and isinstance(group.get(first, {}), dict):
        inner = group.setdefault(first, {})
        for key, part in value.items():
            _put(inner, (key,), part, f"{path}.")
    elif first in group:
        raise ConfigError(f"{path} is given twice: remove one of them")
    else:
        group[first] = value


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
    *groups, last = keys = _keys_of(path)
    plain = _plain_keys()
    for depth, key in enumerate(groups, start=1):
        below = group.get(key, {})
        if not isinstance(below, Mapping) or ".".join(groups[:depth]) in plain:
            raise ConfigError(f"--set {path}: {key} is a single value, not a group of keys")
        group[key] = dict(below)
        group = group[key]
    group[last] = value
    given: dict[str, Any] = {}
    _put(given, keys, value)
    warn_of_names(given)
    return result


def changed_keys(config: DesignConfig) -> dict[str, Any]:
    """Dotted key -> value of what is not the default and says how a run differs from others.

    Without `settings.`, and without what lists of runs name anyway: task, workflow, engine, seed,
    model.
    """
    changed = _flatten(config.model_dump(mode="json", exclude_defaults=True))
    return {key: value for key, value in changed.items() if key not in _LISTED}


def differing_text(runs: Sequence[Mapping[str, Any]]) -> list[str]:
    """What differs between runs, given the `changed_keys` of each: "rounds=2, history=False".

    A key with its default is left out, so the text of a run may be empty.
    """
    keys = dict.fromkeys(key for run in runs for key in run)
    differing = [key for key in keys if any(run.get(key) != runs[0].get(key) for run in runs)]
    return [
        ", ".join(f"{key}={_short(run[key])}" for key in differing if key in run) for run in runs
    ]


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= _WIDE else f"{text[: _WIDE - 3]}..."


def _flatten(group: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Dotted key -> value of nested groups; `settings.` is left out."""
    found: dict[str, Any] = {}
    for key, value in group.items():
        path = above + key
        if isinstance(value, dict) and path not in _plain_keys():
            found |= _flatten(value, "" if path == "settings" else f"{path}.")
        else:
            found[path] = value
    return found


def values_in(
    document: Mapping[str, Any], above: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Path and value of everything that is not a group of keys."""
    for key, value in document.items():
        if isinstance(value, Mapping) and value:
            yield from values_in(value, (*above, key))
        else:
            yield (*above, key), value


def suggest_key(knobs: Iterable[str]) -> str:
    """A hint for unknown knobs that look like a configuration key; "" if none does.

    `rounds` also matches `search.rounds`.
    """
    keys = [key.removeprefix("settings.") for key, _ in _keys_in(DesignConfig)]
    for knob in knobs:
        parts = knob.count(".") + 1
        ends = {".".join(key.split(".")[-parts:]): key for key in reversed(keys)}
        near = get_close_matches(knob, ends, n=1, cutoff=0.75)
        if near:
            return f"; did you mean the configuration key {ends[near[0]]!r}?"
    return ""


def _keys_in(kind: type[BaseModel], above: str = "") -> Iterator[tuple[str, bool]]:
    """Every dotted key, and whether it holds one value: neither a group of keys nor a mapping.

    A group of keys precedes its members.
    """
    for name, field in kind.model_fields.items():
        inner = field.annotation
        group = inner if isinstance(inner, type) and issubclass(inner, BaseModel) else None
        yield above + name, group is None and get_origin(inner) is not dict
        if group is not None:
            yield from _keys_in(group, f"{above}{name}.")


@cache
def _plain_keys() -> frozenset[str]:
    """Every dotted key that holds one value."""
    return frozenset(key for key, is_plain in _keys_in(DesignConfig) if is_plain)


def build_config(document: object) -> DesignConfig:
    """Validate a document.

    Raises:
        ConfigError: A key is wrong; the message names it, its value, and what was expected.
    """
    if not isinstance(document, Mapping):
        raise ConfigError("the configuration must be a mapping of keys")
    document = spell_out(document)
    try:
        found = DesignConfig.model_validate(update_names(document))
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
    if first in WorkflowSettings.model_fields or f"settings.{path}" in KEYS:
        return ("settings", first, *rest)
    return ("knobs", path)

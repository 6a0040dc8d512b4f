"""Reads a file of design objectives and checks all that can be checked without a simulation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable
from pathlib import Path

from pydantic import ValidationError

from agentflow.config.yaml import NOT_YAML, describe_fault, first_fault, read_yaml
from agentflow.errors import ConfigError, UnknownNameError, UsageError, yaml_problem
from agentflow.training.objectives.objective import Objective

OBJECTIVES = Path("configs/objectives.yaml")
"""The objectives that come with the source code."""


def read_objectives(path: str | Path = OBJECTIVES) -> tuple[Objective, ...]:
    """Read objectives, in the order of the file.

    Raises:
        ConfigError: The file cannot be read, or an objective is wrong; the message names it, what
            is wrong, and what is possible.
    """
    objectives = tuple(_read(entry, path, i) for i, entry in enumerate(_entries(path), start=1))
    counts = Counter(objective.name for objective in objectives)
    if repeated := [name for name, count in counts.items() if count > 1]:
        raise ConfigError(f"{path}: the name {repeated[0]!r} is used twice; names must differ")
    return objectives


def _entries(path: str | Path) -> list[object]:
    try:
        document = read_yaml(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"cannot read the objectives {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"the objectives {path} are not UTF-8 text") from None
    except NOT_YAML as error:
        raise ConfigError(f"{path} is not YAML: {yaml_problem(error)}") from None
    if not isinstance(document, list) or not document:
        raise ConfigError(f"{path} must be a list of objectives")
    return document


def _read(entry: object, path: str | Path, number: int) -> Objective:
    name = entry.get("name") if isinstance(entry, dict) else None
    where = f"objective {name or number} of {path}"
    try:
        objective = Objective.model_validate(entry)
    except ValidationError as error:
        fault = first_fault(error)
        key = ".".join(str(part) for part in fault["loc"]) or "the entry"
        if fault["type"] == "extra_forbidden":
            problem = UnknownNameError("key", key, Objective.model_fields)
            raise ConfigError(f"{where}: {problem}") from None
        raise ConfigError(f"{where}: {key}: {describe_fault(fault)}") from None
    try:
        _check(objective)
    except UsageError as error:
        raise ConfigError(f"{where}: {error}") from None
    return objective


def _check(objective: Objective) -> None:
    """Raise ConfigError if a function test measures something that is not there."""
    scene = objective.task.scene()
    things = [thing.name for thing in scene.things]
    moving = [thing.name for thing in scene.moving]
    for name, test in objective.test.items():
        named = [body for body in test.bodies if isinstance(body, str)]
        types = [body for body in test.bodies if not isinstance(body, str)]
        _expect(name, "allowed block type", types, objective.blocks)
        _expect(name, "thing that moves in the scene", named, moving)
        _expect(name, "thing of the scene", test.obstacles, things)


def _expect(test: str, kind: str, wanted: Iterable[object], known: Collection[object]) -> None:
    if missing := [name for name in wanted if name not in known]:
        raise ConfigError(f"test.{test}: {UnknownNameError(kind, missing[0], known or ['none'])}")

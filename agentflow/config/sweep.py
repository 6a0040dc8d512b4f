"""Owns what a sweep is: a base configuration and axes, and the runs that come of them (spec 6.3).

Carrying them out and making tables of them is app's.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from shlex import quote
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from agentflow.config.run import DesignConfig, build, put
from agentflow.config.yaml import first_fault, in_words, truth_for_number
from agentflow.errors import ConfigError, UnknownNameError

StageChoice = Literal["initial", "blind_refinement", "env_feedback"]
Seed = Annotated[int, Field(ge=-(2**63), lt=2**63)]
"""As in `DesignConfig`."""
Axis = dict[str, dict[str, Any]]
"""Label -> dotted configuration keys and the values that it stands for."""


class Source(BaseModel):
    """Where published numbers for a sweep stand."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    table: str = Field(description="table of the published results")
    conditions: dict[str, str] = Field(
        {}, description="published condition: the sweep's; those left out are not taken; {}: all"
    )


class Layout(BaseModel):
    """How a table is made of a sweep's runs."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    conditions: Literal["axes", "stages", "rounds", "none"] = Field(
        "axes",
        description="what the columns compare: the axes but task, the stages of each run, one "
        "search cut after several rounds, or nothing; axes that do not are rows",
    )
    stage: StageChoice = Field("env_feedback", description="whose machines are counted")
    rounds: tuple[int, ...] = Field((), description="where a search is cut, for rounds")
    metrics: tuple[str, ...] = Field(min_length=1, description="columns of each condition")
    task_metrics: dict[str, tuple[str, ...]] = Field(
        {}, description="tasks that are measured otherwise"
    )
    columns: Literal["condition", "task"] = Field(
        "condition", description="what heads a group of columns; tasks that do not are rows"
    )
    published: tuple[Source, ...] = ()

    @model_validator(mode="after")
    def _cut_somewhere(self) -> Layout:
        if (self.conditions == "rounds") != bool(self.rounds):
            raise ValueError("conditions: rounds and a list of rounds go together")
        return self


class SweepConfig(BaseModel):
    """A sweep as written in YAML."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    title: str = Field(min_length=1, description="heads its table")
    about: str = Field("", description="what it shows, in a sentence or two")
    base: dict[str, Any] = Field({}, description="configuration that all runs share")
    seeds: tuple[Seed, ...] = Field((0,), min_length=1)
    axes: dict[str, Axis] = Field({}, description="what the runs differ in")
    table: Layout

    @field_validator("seeds")
    @classmethod
    def _once(cls, seeds: tuple[int, ...]) -> tuple[int, ...]:
        if len(set(seeds)) < len(seeds):
            raise ValueError(f"{max(seeds, key=seeds.count)} stands there twice")
        return seeds

    @field_validator("axes", mode="before")
    @classmethod
    def _with_labels(cls, axes: object) -> object:
        if not isinstance(axes, Mapping):
            return axes
        return {name: _labelled(name, axis) for name, axis in axes.items()}

    @field_validator("axes")
    @classmethod
    def _neither_empty_nor_of_seeds(cls, axes: dict[str, Axis]) -> dict[str, Axis]:
        for name, axis in axes.items():
            if not axis:
                raise ValueError(f"axis {name} has no values")
            if any("seed" in settings for settings in axis.values()):
                raise ValueError(f"axis {name} sets seed, which the list of seeds does")
        return axes


@dataclass(frozen=True)
class Member:
    """One run of a sweep."""

    name: str
    """Of its run directory."""
    labels: Mapping[str, str]
    """Axis -> label."""
    config: DesignConfig

    @property
    def variant(self) -> str:
        """The labels of all axes but `task`, in order."""
        return ", ".join(label for axis, label in self.labels.items() if axis != "task")


def read_sweep(document: Mapping[str, Any], source: str) -> SweepConfig:
    """Validate a sweep's document.

    Args:
        document: As loaded.
        source: Named in errors.

    Raises:
        ConfigError: A key is unknown or wrong; or this is the configuration of a single run.
    """
    if "table" not in document and "axes" not in document:
        raise ConfigError(
            f"{source} is no sweep: it has neither axes nor a table; a single run is started with "
            f"agentflow design --config {quote(source)}"
        )
    try:
        found = SweepConfig.model_validate(dict(document))
    except ValidationError as error:
        raise ConfigError(f"{source}: {_explain(error)}") from None
    if wrong := truth_for_number(document, found.model_dump()):
        raise ConfigError(f"{source}: {wrong}: expected a number, not true or false")
    return found


def _explain(error: ValidationError) -> str:
    first = first_fault(error)
    place = [str(part) for part in first["loc"]]
    key = ".".join(place)
    if first["type"] == "extra_forbidden":
        kind = Layout if place[0] == "table" else SweepConfig
        known = [".".join([*place[:-1], name]) for name in kind.model_fields]
        return str(UnknownNameError("key", key, known))
    return f"{key} is missing" if first["type"] == "missing" else f"{key}: {in_words(first)}"


def members(sweep: SweepConfig) -> tuple[Member, ...]:
    """All runs: the product of the axes, in their order, times the seeds, which follow each other.

    Raises:
        ConfigError: A configuration is wrong, or two runs would be the same.
    """
    found: dict[str, Member] = {}
    for choice in product(*(axis.items() for axis in sweep.axes.values())):
        labels = dict(zip(sweep.axes, (label for label, _ in choice), strict=True))
        document: dict[str, Any] = dict(sweep.base)
        for _, settings in choice:
            for key, value in settings.items():
                document = put(document, key, value)
        names = [_name([*labels.values(), f"seed-{seed}"]) for seed in sweep.seeds]
        try:
            config = build(document)
        except ConfigError as error:
            raise ConfigError(f"run {names[0]}: {error}") from None
        for name, seed in zip(names, sweep.seeds, strict=True):
            if name in found:
                raise ConfigError(f"two runs of the sweep would be called {name}")
            found[name] = Member(name, labels, config.model_copy(update={"seed": seed}))
    return tuple(found.values())


def varied(sweep: SweepConfig) -> dict[str, str]:
    """Configuration key -> the axis that sets it; `seed` is set by the list of seeds."""
    keys = {
        key: name
        for name, axis in sweep.axes.items()
        for settings in axis.values()
        for key in settings
    }
    return {**keys, "seed": "seeds"}


def _labelled(name: str, axis: object) -> object:
    """An axis as a mapping; a list varies the configuration key that the axis is named after."""
    if isinstance(axis, list):
        found = {str(value): {name: value} for value in axis}
        if len(found) < len(axis):
            twice = next(
                str(value) for i, value in enumerate(axis) if str(value) in map(str, axis[:i])
            )
            raise ValueError(f"axis {name} has {twice} twice")
        return found
    if isinstance(axis, Mapping):
        return {str(label): settings for label, settings in axis.items()}
    return axis


def _name(parts: list[str]) -> str:
    return ".".join(re.sub(r"[^A-Za-z0-9_-]+", "-", part).strip("-") or "-" for part in parts)

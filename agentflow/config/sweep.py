"""Sweeps: a base configuration, axes and seeds, and the runs that they define."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from shlex import quote
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, ValidationError, field_validator, model_validator

from agentflow.config.run import DesignConfig, build_config, set_key
from agentflow.errors import ConfigError
from agentflow.files.faults import explain, find_bool_as_number

StageChoice = Literal["initial", "blind_refinement", "env_feedback"]
Seed = Annotated[int, Field(ge=-(2**63), lt=2**63)]
"""As in `DesignConfig`."""
Axis = dict[str, dict[str, Any]]
"""Label -> dotted configuration keys and their values."""


_BARE = re.compile(r"True|False|None|[-+.\de]*\d[-+.\de]*")
"""Labels that say nothing without the name of their axis."""


class PublishedSource(BaseModel, frozen=True, extra="forbid"):
    """A published table to compare a sweep with.

    Attributes:
        table: Name of the published table.
        conditions: Published condition -> condition of the sweep; {} takes all unchanged.
    """

    table: str
    conditions: dict[str, str] = {}


class TableLayout(BaseModel, frozen=True, extra="forbid"):
    """How a sweep's runs are arranged in a table.

    Attributes:
        conditions: What columns compare: all axes but task, the stages of each run, a search cut
            off after several rounds, or nothing; the other axes are rows.
        stage: Stage whose machines are counted.
        rounds: Rounds after which a search is cut off.
        metrics: Columns of each condition.
        task_metrics: Tasks with other metrics.
        columns: Heading of each group of columns; tasks are rows otherwise.
        published: Published tables to compare with.
    """

    conditions: Literal["axes", "stages", "rounds", "none"] = "axes"
    stage: StageChoice = "env_feedback"
    rounds: tuple[int, ...] = ()
    metrics: tuple[str, ...] = Field(min_length=1)
    task_metrics: dict[str, tuple[str, ...]] = {}
    columns: Literal["condition", "task"] = "condition"
    published: tuple[PublishedSource, ...] = ()

    @model_validator(mode="after")
    def _check_rounds(self) -> TableLayout:
        if (self.conditions == "rounds") != bool(self.rounds):
            raise ValueError(
                "rounds must be listed if conditions is 'rounds', and must be left out otherwise"
            )
        return self


class Par(BaseModel, frozen=True, extra="forbid"):
    """What the shares of an item are counted from and to.

    Attributes:
        floor: Score of random machines: share 0.
        par: Score of a long search or of a known machine: share 1.
    """

    floor: float = Field(allow_inf_nan=False)
    par: float = Field(allow_inf_nan=False)


class BenchmarkSettings(BaseModel, frozen=True, extra="forbid"):
    """What makes a sweep a benchmark: its axes are `part` and `task`, the items.

    Attributes:
        version: Version of the items and parts.
        lowest: Items that count with the lowest score of the verification, not the median.
        pars: Floor and par of each item.
        canary: A text by which copies of the items are found.
        lite: Whether only the first item of each family is left.
        plan: Hash of items and parts; filled in when a run begins.
    """

    version: int = Field(ge=1)
    lowest: tuple[str, ...] = ()
    pars: dict[str, Par] = {}
    canary: str = ""
    lite: bool = False
    plan: str = ""


class SweepConfig(BaseModel, frozen=True, extra="forbid"):
    """A sweep as written in YAML.

    Attributes:
        title: Title of the table.
        about: What the sweep shows, in a sentence or two.
        base: Configuration shared by all runs.
        seeds: Random seeds; every configuration runs once with each.
        axes: What varies between runs.
        benchmark: For benchmarks only.
    """

    title: str = Field(min_length=1)
    about: str = ""
    base: dict[str, Any] = {}
    seeds: tuple[Seed, ...] = Field((0,), min_length=1)
    axes: dict[str, Axis] = {}
    table: TableLayout
    benchmark: BenchmarkSettings | None = None

    @property
    def command(self) -> str:
        """The command that runs it."""
        return "benchmark" if self.benchmark else "sweep"

    @field_validator("seeds")
    @classmethod
    def _unique_seeds(cls, seeds: tuple[int, ...]) -> tuple[int, ...]:
        if len(set(seeds)) < len(seeds):
            raise ValueError(f"{max(seeds, key=seeds.count)} is duplicated")
        return seeds

    @field_validator("axes", mode="before")
    @classmethod
    def _label_axes(cls, axes: object) -> object:
        if not isinstance(axes, Mapping):
            return axes
        return {name: _label_values(name, axis) for name, axis in axes.items()}

    @field_validator("axes")
    @classmethod
    def _check_axes(cls, axes: dict[str, Axis]) -> dict[str, Axis]:
        for name, axis in axes.items():
            if not axis:
                raise ValueError(f"axis {name} has no values")
            if any("seed" in settings for settings in axis.values()):
                raise ValueError(f"axis {name} sets seed; use the list of seeds")
        return axes


@dataclass(frozen=True)
class SweepRun:
    """One run of a sweep."""

    name: str
    labels: Mapping[str, str]
    """Axis -> label."""
    config: DesignConfig

    @property
    def variant(self) -> str:
        """See `variant_of`."""
        return variant_of(self.labels)


def variant_of(labels: Mapping[str, str]) -> str:
    """The labels of all axes but `task`, in order; numbers and truth values with their axis."""
    return ", ".join(
        f"{axis.removeprefix('settings.')}={label.lower()}" if _BARE.fullmatch(label) else label
        for axis, label in labels.items()
        if axis != "task"
    )


def read_sweep(document: Mapping[str, Any], source: str) -> SweepConfig:
    """Validate a sweep's document.

    Args:
        document: As loaded.
        source: File name for error messages.

    Raises:
        ConfigError: A key is unknown or wrong, or this is the configuration of a single run.
    """
    if "table" not in document and "axes" not in document:
        raise ConfigError(
            f"{source} is not a sweep: it has neither axes nor a table; start a single run with "
            f"agentflow design --config {quote(source)}"
        )
    try:
        found = SweepConfig.model_validate(dict(document))
    except ValidationError as error:
        raise ConfigError(f"{source}: {explain(error, SweepConfig, 'key')}") from None
    if wrong := find_bool_as_number(document, found.model_dump()):
        raise ConfigError(f"{source}: {wrong}: expected a number, not true or false")
    return found


def list_runs(sweep: SweepConfig) -> tuple[SweepRun, ...]:
    """All runs: every combination of the axes, in order, with every seed.

    Raises:
        ConfigError: A configuration is wrong, or two runs would have the same name.
    """
    found: dict[str, SweepRun] = {}
    for choice in product(*(axis.items() for axis in sweep.axes.values())):
        labels = dict(zip(sweep.axes, (label for label, _ in choice), strict=True))
        document: dict[str, Any] = dict(sweep.base)
        for _, settings in choice:
            for key, value in settings.items():
                document = set_key(document, key, value)
        names = [_name([*labels.values(), f"seed-{seed}"]) for seed in sweep.seeds]
        try:
            config = build_config(document)
        except ConfigError as error:
            raise ConfigError(f"run {names[0]}: {error}") from None
        for name, seed in zip(names, sweep.seeds, strict=True):
            if name in found:
                raise ConfigError(f"two runs of the sweep would be named {name}")
            found[name] = SweepRun(name, labels, config.model_copy(update={"seed": seed}))
    return tuple(found.values())


def axis_of_key(sweep: SweepConfig) -> dict[str, str]:
    """Configuration key -> the axis that sets it; for `seed`, the list of seeds."""
    keys = {
        key: name
        for name, axis in sweep.axes.items()
        for settings in axis.values()
        for key in settings
    }
    return {**keys, "seed": "seeds"}


def _label_values(name: str, axis: object) -> object:
    """An axis as a mapping; a list holds values of the key that the axis is named after."""
    if isinstance(axis, list):
        labels = [str(value) for value in axis]
        if repeated := [label for label in labels if labels.count(label) > 1]:
            raise ValueError(f"axis {name} has {repeated[0]} twice")
        return {str(value): {name: value} for value in axis}
    if isinstance(axis, Mapping):
        return {str(label): settings for label, settings in axis.items()}
    return axis


def _name(parts: list[str]) -> str:
    return ".".join(re.sub(r"[^A-Za-z0-9_-]+", "-", part).strip("-") or "-" for part in parts)

"""Owns how a sweep is read and laid out: settings over its base, every name looked up, its folder.

Carrying it out is run.py's.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from agentflow.app.design.config import (
    fill_from_environment,
    require_model_name,
    urls_with_credentials,
)
from agentflow.app.design.plan import RunPlan
from agentflow.app.sweeps.folder import folder_name, is_sweep, read_folder
from agentflow.config.run import build, load, override, put
from agentflow.config.sweep import Member, SweepConfig, members, read_sweep, varied
from agentflow.errors import ConfigError, UsageError
from agentflow.metrics.cells import check_metrics
from agentflow.metrics.published import check_source


@dataclass(frozen=True)
class SweepPlan:
    """A sweep whose every name has been looked up."""

    name: str
    sweep: SweepConfig
    firsts: tuple[Member, ...]
    """Of the runs that differ in nothing but the seed, the first."""
    plans: tuple[RunPlan, ...]
    """Of each of them; what is looked up, seeds do not change."""

    @cached_property
    def members(self) -> tuple[Member, ...]:
        """All runs."""
        return members(self.sweep)

    def plan_of(self, member: Member) -> RunPlan:
        """The plan of a run, but for its seed."""
        return self._by_labels[tuple(member.labels.values())]

    @cached_property
    def _by_labels(self) -> dict[tuple[str, ...], RunPlan]:
        found = zip(self.firsts, self.plans, strict=True)
        return {tuple(first.labels.values()): plan for first, plan in found}

    @classmethod
    def of(cls, name: str, sweep: SweepConfig) -> SweepPlan:
        """Look up tasks, workflows, prompts, metrics and published tables.

        Raises:
            UnknownNameError: One of them does not exist.
            ConfigError: A configuration is wrong, or an axis holds credentials.
        """
        check_metrics(sweep.table.metrics)
        for metrics in sweep.table.task_metrics.values():
            check_metrics(metrics)
        for source in sweep.table.published:
            check_source(source.table)
        firsts = members(sweep.model_copy(update={"seeds": sweep.seeds[:1]}))
        _demand_no_credentials(sweep, firsts)
        return cls(name, sweep, firsts, tuple(RunPlan.of(first.config) for first in firsts))


def plan_sweep(
    path: Path, settings: Iterable[str], options: Mapping[str, Any], seeds: int | None = None
) -> SweepPlan:
    """Read a sweep, lay settings over its base and look everything up.

    Args:
        path: The YAML file, or the folder of a sweep that was begun.
        settings: `a.b=value` each, of all runs.
        options: Dotted configuration keys of all runs; None means not given.
        seeds: How many seeds, from 0, instead of the file's.

    Raises:
        ConfigError: A key is unknown, or set although an axis varies it.
        UnknownNameError: A task, workflow, metric or the like does not exist.
    """
    given = {key: value for key, value in options.items() if value is not None}
    if is_sweep(path):
        if list(settings) or given or seeds is not None:
            raise UsageError(
                f"{path} is continued as it was begun; leave out --model, --base-url, --set "
                "and --seeds"
            )
        document, sweep = read_folder(path)
        return SweepPlan.of(document["name"], sweep)
    sweep = read_sweep(load(path), str(path))
    if "seed" in sweep.base:
        raise ConfigError(
            f"{path}: base.seed: seeds are listed under seeds, for instance seeds: [0]"
        )
    axes = varied(sweep)
    for key in [*(setting.partition("=")[0].strip() for setting in settings), *given]:
        if key.removeprefix("settings.") in {name.removeprefix("settings.") for name in axes}:
            raise ConfigError(
                f"{key} is what the sweep varies ({axes.get(key, 'axes')}): it cannot be set "
                "for all runs; --seeds N sets the seeds"
            )
    base = override(sweep.base, settings)
    for key, value in given.items():
        base = put(base, key, value)
    changed: dict[str, Any] = {"base": fill_from_environment(base, os.environ)}
    if seeds is not None:
        changed["seeds"] = tuple(range(seeds))
    plan = SweepPlan.of(path.stem, sweep.model_copy(update=changed))
    for member in plan.firsts:
        require_model_name(member.config.model)
    return plan


def folder_of(plan: SweepPlan, path: Path, out: Path) -> Path:
    """Where a sweep lies: at `path` if that is its folder, else under `out`."""
    return path if is_sweep(path) else out / folder_name(plan.name, plan.sweep)


def _demand_no_credentials(sweep: SweepConfig, found: Iterable[Member]) -> None:
    """What axes hold is written down, and names runs; what the base holds is not."""
    known = urls_with_credentials(build(sweep.base))
    for member in found:
        if urls_with_credentials(member.config) - known:
            raise ConfigError(
                "an axis has a base URL with a user or a query, which would be written down; "
                "name the environment variable of the key in model.key_variable instead"
            )

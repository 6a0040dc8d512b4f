"""Sweep plans: a sweep with settings applied to its base, and every name looked up."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from agentflow.app.design.config import set_options, urls_with_credentials
from agentflow.app.design.plan import RunPlan
from agentflow.app.design.trust import Approve, refuse, require_trust
from agentflow.app.sweeps.folder import folder_name, is_sweep, read_folder
from agentflow.config.run import DesignConfig, build_config, load_document
from agentflow.config.sweep import SweepConfig, SweepRun, axis_of_key, list_runs, read_sweep
from agentflow.env.physics.engines import choose_engine
from agentflow.errors import ConfigError, UsageError
from agentflow.metrics.cells import check_metrics
from agentflow.metrics.published import check_source
from agentflow.models.completion import (
    complete_local_model,
    fill_from_environment,
    require_model_name,
)


@dataclass(frozen=True)
class SweepPlan:
    """A sweep whose names have all been looked up.

    `firsts` has the first run of each group of runs that differ only in the seed, `plans` the plan
    of each of these.
    """

    name: str
    sweep: SweepConfig
    firsts: tuple[SweepRun, ...]
    plans: tuple[RunPlan, ...]

    @cached_property
    def runs(self) -> tuple[SweepRun, ...]:
        """All runs."""
        return list_runs(self.sweep)

    @property
    def configs(self) -> list[DesignConfig]:
        """The configurations of `firsts`."""
        return [first.config for first in self.firsts]

    def plan_of(self, run: SweepRun) -> RunPlan:
        """The plan of a run, except for its seed."""
        return self._by_labels[tuple(run.labels.values())]

    @cached_property
    def _by_labels(self) -> dict[tuple[str, ...], RunPlan]:
        found = zip(self.firsts, self.plans, strict=True)
        return {tuple(first.labels.values()): plan for first, plan in found}

    @classmethod
    def of(cls, name: str, sweep: SweepConfig) -> SweepPlan:
        """Look up tasks, workflows, engines, prompts, metrics and published tables.

        The base names the engine that `auto` stands for here, so that a sweep keeps its engine.
        """
        check_metrics(sweep.table.metrics)
        for metrics in sweep.table.task_metrics.values():
            check_metrics(metrics)
        for source in sweep.table.published:
            check_source(source.table)
        engine = choose_engine(build_config(sweep.base).engine)
        sweep = sweep.model_copy(update={"base": {**sweep.base, "engine": engine.name}})
        firsts = list_runs(sweep.model_copy(update={"seeds": sweep.seeds[:1]}))
        _refuse_credentials(sweep, firsts)
        return cls(name, sweep, firsts, tuple(RunPlan.of(first.config) for first in firsts))


def plan_sweep(
    path: Path,
    settings: Iterable[str],
    options: Mapping[str, Any],
    seeds: Sequence[int] | int | None = None,
    approve: Approve = refuse,
    adapt: Callable[[SweepConfig], SweepConfig] = lambda sweep: sweep,
    *,
    answered: bool = False,
) -> SweepPlan:
    """Read a sweep, apply settings to its base, and look everything up.

    Args:
        path: The YAML file, or an existing sweep folder.
        settings: Strings `a.b=value` for all runs.
        options: Dotted configuration keys for all runs; None means not given.
        seeds: In place of those in the file; a number gives 0, 1, ...
        approve: Is asked about hosts and key variables that only the file names.
        adapt: Changes the sweep that was read from the file.
        answered: Whether functions answer in place of models.

    Raises:
        UnknownNameError: A task, workflow, metric ... does not exist.
        ConfigError: A configuration is wrong, a setting is varied by an axis, or an axis holds
            credentials.
    """
    settings = list(settings)
    given = {key: value for key, value in options.items() if value is not None}
    if is_sweep(path):
        if settings or given or seeds is not None:
            raise UsageError(
                f"{path} is resumed with its own settings; remove --model, --base-url, "
                "--engine, --set and --seeds"
            )
        document, sweep = read_folder(path)
        plan = SweepPlan.of(document["name"], sweep)
        require_trust(path, plan.configs, {}, approve)
        return plan
    sweep = adapt(read_sweep(load_document(path), str(path)))
    plan = plan_config(
        path.stem, sweep, settings, given, seeds, source=str(path), answered=answered
    )
    if not answered:
        require_trust(path, plan.configs, set_options({}, settings, given), approve)
    return plan


def plan_config(
    name: str,
    sweep: SweepConfig,
    settings: Iterable[str],
    given: Mapping[str, Any],
    seeds: Sequence[int] | int | None,
    *,
    source: str,
    answered: bool = False,
) -> SweepPlan:
    """Apply settings to a sweep's base, and look everything up; see `plan_sweep`.

    Args:
        name: Of the sweep.
        sweep: As read.
        settings: Strings `a.b=value`.
        given: Dotted configuration keys.
        seeds: In place of the sweep's; a number gives 0, 1, ...
        source: File name for error messages.
        answered: Whether functions answer in place of models.
    """
    settings = list(settings)
    if "seed" in sweep.base:
        raise ConfigError(f"{source}: base.seed: list seeds under seeds, for example seeds: [0]")
    axes = axis_of_key(sweep)
    for key in [*(setting.partition("=")[0].strip() for setting in settings), *given]:
        if key.removeprefix("settings.") in {name.removeprefix("settings.") for name in axes}:
            raise ConfigError(
                f"{key} is varied by the sweep ({axes.get(key, 'axes')}) and cannot be set for all "
                "runs; to set the seeds, use --seeds N"
            )
    base = set_options(sweep.base, settings, given)
    changed: dict[str, Any] = {}
    if not answered:
        base = dict(complete_local_model(fill_from_environment(base, os.environ)))
        changed["axes"] = {
            axis: {label: _with_label(settings, base) for label, settings in conditions.items()}
            for axis, conditions in sweep.axes.items()
        }
    changed["base"] = base
    if seeds is not None:
        changed["seeds"] = tuple(range(seeds)) if isinstance(seeds, int) else tuple(seeds)
    plan = SweepPlan.of(name, sweep.model_copy(update=changed))
    for run, first in zip(plan.firsts, plan.plans, strict=True):
        if not answered:
            require_model_name(run.config.model)
        first.require_workflow()
    return plan


def _with_label(settings: Mapping[str, Any], base: Mapping[str, Any]) -> Mapping[str, Any]:
    """Settings of a condition; if they name a model, with the label of its folder, or with none in
    place of that of the base."""
    if "model.name" not in settings or "model.label" in settings:
        return settings
    model = base.get("model", {})
    url = settings.get("model.base_url", model.get("base_url"))
    named = complete_local_model({"model": {"name": settings["model.name"], "base_url": url}})
    found = named["model"]
    if "label" not in found and "label" not in model:
        return settings
    return {**settings, "model.name": found["name"], "model.label": found.get("label")}


def sweep_folder(plan: SweepPlan, path: Path, out: Path) -> Path:
    """The folder of a sweep: `path` if it is one, else a folder in `out`."""
    return path if is_sweep(path) else out / folder_name(plan.name, plan.sweep)


def _refuse_credentials(sweep: SweepConfig, found: Iterable[SweepRun]) -> None:
    """Refuse credentials in axes, which are written to files and to the names of runs."""
    known = urls_with_credentials(build_config(sweep.base))
    for run in found:
        if urls_with_credentials(run.config) - known:
            raise ConfigError(
                "an axis has a base URL with a user name or a query string, which may contain an "
                "API key and would be written to files; put the key in an environment variable "
                "and name that variable in model.key_variable"
            )

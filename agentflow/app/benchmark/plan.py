"""Plans of benchmarks: sweeps with fixed items and parts, of which users set only the model.

Every item (axis `task`) is done in every part (axis `part`) that is chosen: `first`, single replies
without any feedback, and runs with feedback. Random machines and edits can take the place of a
model, with as many simulations.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from agentflow.app.benchmark.card import DIGITS, FIRST
from agentflow.app.design.trust import Approve, refuse
from agentflow.app.sweeps.folder import is_sweep
from agentflow.app.sweeps.plan import SweepPlan, plan_sweep
from agentflow.config.run import DesignConfig, build_config
from agentflow.config.sweep import BenchmarkSettings, Par, SweepConfig, list_runs
from agentflow.env.physics.engines import physics_conditions
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_level, get_task
from agentflow.errors import ConfigError, UsageError
from agentflow.files.documents import digest_of
from agentflow.prompts.render import PromptSet
from agentflow.workflows.registry import WORKFLOWS

PART, ITEM = "part", "task"
CALLS = "model.budget.calls"
"""A part that sets it is over after so many calls, and its best machine counts."""
VERSION = 2
"""The greatest version of a benchmark that is known."""
MOST = 1.5
"""Greatest share, so that no item outweighs the others."""


def plan_benchmark(
    path: Path,
    settings: Iterable[str],
    options: Mapping[str, Any],
    *,
    lite: bool = False,
    random: bool = False,
    parts: Sequence[str] = (),
    seeds: int | None = None,
    approve: Approve = refuse,
) -> SweepPlan:
    """Read a benchmark and look everything up.

    Args:
        path: The YAML file, or the folder of a benchmark to resume.
        settings: Strings `model.a.b=value`.
        options: Dotted configuration keys; None means not given.
        lite: Whether to do only the first item of each family.
        random: Whether random machines and edits take the place of the model.
        parts: Names of parts; by default the first two.
        seeds: How many seeds; 1 by default.
        approve: Is asked about hosts and key variables that only the file names.

    Raises:
        UsageError: A setting is not about the model, or the file is not a benchmark.
        ConfigError: The file is wrong.
    """
    settings = list(settings)
    for setting in settings:
        if not setting.startswith("model."):
            raise UsageError(
                f"a benchmark has a fixed plan, so --set takes only keys of the model such as "
                f"model.sampling.temperature=0.5, not {setting!r}"
            )
    if is_sweep(path) and (lite or random or parts):
        raise UsageError(
            f"{path} is resumed with its own settings; remove --lite, --random and --part"
        )
    adapt = partial(_adapt, source=path, lite=lite, random=random, parts=parts)
    plan = plan_sweep(path, settings, options, seeds, approve=approve, adapt=adapt)
    benchmark_of(plan.sweep)
    several = f"-{seeds}-seeds" if (seeds or 1) > 1 else ""
    names = "".join(f"-{part}" for part in parts)
    variant = f"{plan.name}{'-lite' * lite}{'-random-dsl' * random}{names}{several}"
    return replace(plan, name=variant)


def benchmark_of(sweep: SweepConfig) -> BenchmarkSettings:
    """The settings of a benchmark; raises UsageError if it is an ordinary sweep."""
    if sweep.benchmark is None:
        raise UsageError(
            f"{sweep.title!r} is not a benchmark but an ordinary sweep; run it with agentflow sweep"
        )
    return sweep.benchmark


def item_configs(sweep: SweepConfig) -> dict[str, DesignConfig]:
    """Name of each item -> the configuration of one of its runs."""
    return {run.labels[ITEM]: run.config for run in list_runs(sweep)}


@dataclass(frozen=True)
class Item:
    """One item of a benchmark."""

    task: Task
    knobs: Mapping[str, Any]
    lowest: bool
    """Whether the lowest score of the verification counts, not the median."""
    par: Par
    """Its floor and par: the scores that shares of 0 and 1 stand for."""

    def share(self, score: float) -> float:
        """What a score counts for."""
        return share_of(score, self.par.floor, self.par.par, MOST)


def share_of(score: float, floor: float, full: float, most: float) -> float:
    """What a score counts for: 0 at or below the floor, 1 if full, and never above the most."""
    return round(min(max((score - floor) / (full - floor), 0.0), most), DIGITS)


def read_items(sweep: SweepConfig) -> dict[str, Item]:
    """The items by name; raises ConfigError if one has no floor and par, or cannot be built."""
    found, settings = {}, benchmark_of(sweep)
    for name, config in item_configs(sweep).items():
        try:
            task = get_task(config.task, config.knobs)
        except ConfigError as error:
            raise ConfigError(f"the item {name} cannot be built: {error}") from None
        par = settings.pars.get(name)
        if par is None or par.par <= par.floor:
            raise ConfigError(f"benchmark.pars: {name} needs a par above its floor")
        found[name] = Item(task, dict(config.knobs), name in settings.lowest, par)
    return found


def conditions(sweep: SweepConfig) -> dict[str, Any]:
    """Everything that two scorecards must share to be comparable."""
    settings = benchmark_of(sweep)
    items = read_items(sweep).items()
    return {
        "version": settings.version,
        "lite": settings.lite,
        "plan": settings.plan,
        **physics_conditions(build_config(sweep.base).engine),
        "prompts": PromptSet().digest,
        "pars": digest_of({name: item.par.model_dump() for name, item in items}),
    }


def _adapt(
    sweep: SweepConfig, source: Path, lite: bool, random: bool, parts: Sequence[str]
) -> SweepConfig:
    """The sweep in the file, checked, reduced to the chosen parts and items, and without a model if
    `random`."""
    settings = benchmark_of(sweep)
    _check(sweep, source)
    known = tuple(sweep.axes[PART])
    if unknown := [part for part in parts if part not in known]:
        raise UsageError(f"{source} has no part {unknown[0]}: choose from {', '.join(known)}")
    axes = {part: dict(sweep.axes[part]) for part in (PART, ITEM)}
    if lite:
        configs = reversed(item_configs(sweep).items())
        firsts = {get_level(config.task).file.family: name for name, config in configs}
        axes[ITEM] = {name: axes[ITEM][name] for name in axes[ITEM] if name in firsts.values()}
    digest = digest_of([sweep.base, axes, settings.lowest])
    settings = settings.model_copy(update={"lite": lite, "plan": digest})
    chosen = parts or known[:2]
    axes[PART] = {part: changes for part, changes in axes[PART].items() if part in chosen}
    if random:
        axes = {
            axis: {name: _without_model(changes) for name, changes in values.items()}
            for axis, values in axes.items()
        }
    return sweep.model_copy(update={"axes": axes, "benchmark": settings})


def _check(sweep: SweepConfig, source: Path) -> None:
    """Raise ConfigError unless axes, seeds and items are those of a benchmark."""
    version = benchmark_of(sweep).version
    if version > VERSION:
        raise ConfigError(
            f"{source}: benchmark.version: it is {version}, and this agentflow knows versions up "
            f"to {VERSION}: use a later one"
        )
    if list(sweep.axes) != [PART, ITEM] or [*sweep.axes[PART]][:1] != [FIRST]:
        raise ConfigError(
            f"{source}: axes: a benchmark has the axis {PART}, which begins with {FIRST}, and then "
            f"the axis {ITEM}, with the items"
        )
    if len(sweep.seeds) > 1:
        raise ConfigError(
            f"{source}: seeds: a benchmark has one seed, for example seeds: [0]; for more, give "
            "--seeds"
        )
    for name, changes in sweep.axes[ITEM].items():
        if "task" not in changes:
            raise ConfigError(f"{source}: axes.{ITEM}.{name}: name the level with task")
    if any(config.settings.known_lessons for config in item_configs(sweep).values()):
        raise ConfigError(f"{source}: known_lessons: a benchmark shows no lessons of other runs")
    read_items(sweep)
    settings = benchmark_of(sweep)
    if unknown := [name for name in settings.lowest if name not in sweep.axes[ITEM]]:
        raise ConfigError(f"{source}: benchmark.lowest: there is no item {unknown[0]}")


def _without_model(changes: Mapping[str, Any]) -> dict[str, Any]:
    """The changes of a condition with the baseline of their workflow, if they name one."""
    if "workflow" not in changes:
        return dict(changes)
    workflow = WORKFLOWS[changes["workflow"]]
    if not workflow.baseline:
        raise UsageError(f"the workflow {workflow.name} has no baseline: remove --random")
    return {**changes, "workflow": workflow.baseline}

"""Commands for sweeps and their tables. Importing this module registers them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agentflow.cli import options
from agentflow.cli.display.text import escape_controls
from agentflow.cli.root import PARTLY, allow, approve, commands, print_json, print_table
from agentflow.errors import UsageError
from agentflow.metrics.tables import counted, duration

if TYPE_CHECKING:
    from agentflow.app.sweeps.estimates import Estimate
    from agentflow.app.sweeps.plan import SweepPlan
    from agentflow.app.sweeps.run import SweepOutcome

LISTED = 1000
"""A dry run lists at most this many runs one by one; more are listed by group of seeds."""
NO_ENDPOINT = 4
"""Exit status: all runs failed because of the endpoint."""


@commands.command(epilog="Example: agentflow sweep inspector --dry-run")
def sweep(
    config: Path,
    model: options.ModelName = None,
    base_url: options.BaseUrl = None,
    settings: options.Settings = None,
    engine: options.Engine = None,
    seeds: Annotated[int | None, typer.Option(min=1)] = None,
    jobs: options.Jobs = 2,
    workers: options.SharedWorkers = None,
    backend: options.Backend = "local",
    store: str | None = None,
    out: Path = Path("sweeps"),
    resume: options.ResumeRuns = False,
    dry_run: options.DryRun = False,
    trust: options.Trust = False,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> None:
    """Run configurations that differ in a few settings.

    `agentflow table` compares the results.

    Args:
        config: Sweep file, name of one in configs, or existing sweep directory.
        seeds: Use seeds 0 to N-1 instead of those in the file.
        store: URL of a store of simulations that sweeps share, such as s3://bucket/store or
            file:///shared/store.
        out: Parent directory for sweeps.
    """
    from agentflow.app.design.trust import trust_option
    from agentflow.app.sweeps.plan import plan_sweep, sweep_folder
    from agentflow.app.sweeps.run import run_blocking, run_sweep_async
    from agentflow.cli.display.sweep_live import watch_sweep

    keys = {"model.name": model, "model.base_url": base_url, "engine": engine, "workers": workers}
    allowed = allow if trust or dry_run else approve
    plan = plan_sweep(config, settings or (), keys, seeds, allowed)
    folder = sweep_folder(plan, config, out)
    if dry_run:
        print_estimate(plan, folder, as_json)
        return
    with watch_sweep(len(plan.runs), quiet) as watcher:
        work = run_sweep_async(
            plan, folder, watcher, jobs=jobs, resume=resume, on=backend, shared_store=store
        )
        outcome = run_blocking(work, plan, folder)
    if as_json:
        done, failed = list(outcome.done), dict(outcome.failed)
        print_json({"sweep": str(outcome.path), "done": done, "failed": failed})
    else:
        print(escape_controls(_outcome_text(outcome, trust_option(plan.configs)), "\n"))
    if outcome.failed:
        raise typer.Exit(NO_ENDPOINT if outcome.endpoint and not outcome.done else PARTLY)


@commands.command(epilog="Example: agentflow table sweeps/inspector --format md --published")
def table(
    folders: list[Path],
    show: options.ViewName = "published",
    against: Annotated[str | None, typer.Option(metavar="CONDITION")] = None,
    form: options.FormatOrJson = "text",
    published: options.Published = False,
) -> None:
    """Compare the runs of sweeps, or evaluated models and their training, in a table.

    Runs outside a sweep are compared by what differs between them. Evaluations with the same name
    are pooled into one row.

    Args:
        folders: Sweeps, finished or not, and directories of runs, in one table; or directories that
            are or contain evaluations and training runs.
        show: View. published: columns as in the published table. scores: means with intervals; for
            a sweep, also Best@N (expected best score of N machines). For a sweep only: usage
            (calls, tokens, time); human (best score divided by the mean score of experienced
            players); expansions (best score by number of new machines); verified (scores of best
            machines and their verified scores); mechanisms (how many runs found machines of each
            mechanism class, and how good). For evaluations and training runs only: transfer (scores
            next to the tasks of training); best (Best@N, also by step of training); curves (every
            number logged in training, by step).
        against: Show differences from this condition of a sweep: paired by seed, with intervals,
            how often each condition is better, and how many seeds would be needed.
    """
    from agentflow.app.sweeps.against import holds_runs
    from agentflow.app.sweeps.views import view

    if all(map(holds_runs, folders)):
        print_table(view(folders, show, published=published, against=against), form)
    elif against is not None:
        raise UsageError("--against compares conditions of sweeps: name their directories only")
    else:
        from agentflow.training.evaluation.tables import format_tables

        print_table(format_tables(folders, show, form, published=published), form)


def print_estimate(plan: SweepPlan, folder: Path, as_json: bool) -> None:
    """Print the estimated cost of the runs that are left."""
    from agentflow.app.sweeps.estimates import NOTHING, estimate
    from agentflow.app.sweeps.folder import RUNS
    from agentflow.app.sweeps.unread import unread_note, unused_note
    from agentflow.config.run import build_config
    from agentflow.models.choices import choose_models

    base, seeds = build_config(plan.sweep.base), len(plan.sweep.seeds)
    wanted = set(map(str, plan.sweep.seeds))
    one_by_one = as_json or len(plan.firsts) * seeds <= LISTED
    runs: list[dict[str, Any]] = []
    left, undone = NOTHING, 0
    for first, its in zip(plan.firsts, plan.plans, strict=True):
        cost = estimate(its)
        stem = first.name.removesuffix(str(plan.sweep.seeds[0]))
        found = (path.parent.name for path in (folder / RUNS).glob(f"{stem}*/result.json"))
        done = {name for name in found if name.removeprefix(stem) in wanted}
        left, undone = left + cost.times(seeds - len(done)), undone + seeds - len(done)
        names = [f"{stem}{seed}" for seed in plan.sweep.seeds] if one_by_one else []
        runs += [{"run": name, "done": name in done, **_estimate_json(cost)} for name in names]
        if not one_by_one:
            print(
                f"{first.name} ... {stem}{plan.sweep.seeds[-1]}: {seeds} runs, {len(done)} done, "
                f"{_cost_text(_estimate_json(cost))} each"
            )
    whole = _estimate_json(left)
    who = [one for first in plan.firsts for one in choose_models(first.config.model).values()]
    unread = unread_note(plan.sweep) if any(one.procedural for one in who) else ""
    note = "\n".join(filter(None, [unused_note(plan.sweep), unread]))
    if as_json:
        print_json({"sweep": str(folder), "runs": runs, "left": whole, "note": note})
        return
    for run in runs:
        state = "done" if run["done"] else _cost_text(run)
        print(f"{run['run']}: {state}")
    print(_remaining_text(whole, undone, all(one.procedural for one in who), base.workers))
    if note:
        print(note)


def _estimate_json(cost: Estimate) -> dict[str, Any]:
    return {**asdict(cost), "worker_seconds": round(cost.worker_seconds, 1)}


def _cost_text(cost: Mapping[str, Any]) -> str:
    """Calls and simulations of one run."""
    return f"{cost['calls']} calls, {_simulations_text(cost)}"


def _simulations_text(cost: Mapping[str, Any]) -> str:
    more = {"robust scores": cost["perturbation"], "verification": cost["verification"]}
    told = [f"{cost['rollouts']} rollouts"]
    return " and ".join(told + [f"{count} for {why}" for why, count in more.items() if count])


def _remaining_text(cost: Mapping[str, Any], runs: int, procedural: bool, workers: int) -> str:
    lasts = duration(cost["worker_seconds"] / workers)
    tokens = cost["prompt_tokens"] + cost["completion_tokens"]
    if procedural:
        priced, answers = "No tokens and no cost, because the procedural model is used", ""
    else:
        money = cost["money"]
        price = "unknown (model.prices is not set)" if money is None else f"{money:.2f}"
        priced = f"About {tokens} tokens, excluding reasoning; cost {price}"
        answers = ", plus the time of the model calls"
    return (
        f"{counted(runs, 'run')} to do: about {cost['calls']} calls (excluding "
        f"retries), at most {_simulations_text(cost)}, about {lasts} with "
        f"{counted(workers, 'worker')}{answers}. {priced}."
    )


def _outcome_text(outcome: SweepOutcome, trust: str) -> str:
    runs, folder = len(outcome.done) + len(outcome.failed), quote(str(outcome.path))
    lines = [f"{len(outcome.done)} of {runs} runs done: {outcome.path}"]
    lines += [f"failed: {name}: {reason}" for name, reason in outcome.failed.items()]
    if outcome.failed:
        lines.append(f"retry the failed runs with: agentflow sweep {folder} --resume{trust}")
    if outcome.done:
        lines.append(f"compare them with: agentflow table {folder}")
    return "\n".join(lines)

"""Commands for recorded runs and for configurations. Importing this module registers them."""

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli import options
from agentflow.cli.root import commands, print_result, subcommands
from agentflow.metrics.failure_kinds import KINDS

config_commands = subcommands(
    "config",
    help="Inspect configurations.",
    epilog="Example: agentflow config show --set search.rounds=2",
)


@config_commands.command(
    "show", epilog="Example: agentflow config show --set search.rounds=2 --set wall.height=0"
)
def show_config(
    config: options.Config = None, settings: options.Settings = None, as_json: options.Json = False
) -> None:
    """Print the configuration of a run and the source of each value.

    Sources: default, file, --set, environment. The output is itself a configuration file.
    """
    from agentflow.app.configuration import annotated_yaml, resolve_config

    found = resolve_config(config, settings or ())
    print_result(found, as_json, lambda value: print(annotated_yaml(value)))


@commands.command(epilog="Example: agentflow runs runs")
def runs(
    folder: Annotated[Path, typer.Argument()] = Path("runs"), as_json: options.Json = False
) -> None:
    """List runs with task, workflow, model, score, cost and state.

    States: done, running, stopped (resume it with `design --resume`), damaged.

    Args:
        folder: Directory that contains runs.
    """
    from agentflow.app.inspect.overview import run_list
    from agentflow.cli.display.show_runs import show_runs

    print_result(list(run_list(folder)), as_json, show_runs)


@commands.command(epilog="Example: agentflow show runs/recorded-throwing")
def show(run: options.Run, as_json: options.Json = False) -> None:
    """Show the stages, best machine, cost and failures of one run."""
    from agentflow.app.inspect.overview import run_details
    from agentflow.cli.display.show_runs import show_run

    print_result(run_details(run), as_json, show_run)


@commands.command(epilog="Example: agentflow rescore runs/recorded-throwing")
def rescore(
    run: options.Run,
    engine: str | None = None,
    workers: Annotated[int | None, typer.Option(min=1)] = None,
    as_json: options.Json = False,
) -> None:
    """Simulate the machines of a run again, also with another engine; list the differences.

    The run itself is not changed.

    Args:
        engine: Another physics engine, such as mujoco; default: that of the run.
        workers: Worker processes; default: as in the run.
    """
    from agentflow.app.subjects.verify import rescore as simulate_again
    from agentflow.cli.display.show_runs import show_rescored

    print_result(simulate_again(run, workers, engine), as_json, show_rescored)


_RULES = "\n\n".join(f"{kind.name} ({kind.level}, {kind.unit}): {kind.rule}" for kind in KINDS)


@commands.command(
    epilog="Example: agentflow failures runs/recorded-throwing",
    help="Count what went wrong in replies and machines, classified by fixed rules.\n\n"
    "A rejected reply counts as exactly one kind. An accepted reply can only count as `rationale "
    "not followed`. A machine is counted once per kind, however often it was simulated.\n\n"
    "The kinds of failure; in parentheses, the category and whether replies or machines are "
    "counted:\n\n" + _RULES,
)
def failures(
    source: Annotated[
        Path, typer.Argument(help="Run directory, or directory that contains runs or sweeps.")
    ],
    as_json: options.Json = False,
) -> None:
    from agentflow.app.inspect.failures import count_failures
    from agentflow.cli.display.show_runs import show_failures

    print_result(count_failures(source), as_json, show_failures)

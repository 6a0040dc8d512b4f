"""Commands for recorded runs and for configurations. Importing this module registers them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli.root import Config, Json, Run, Settings, commands, print_json

config_commands = typer.Typer(
    help="Inspect configurations.",
    epilog="Example: agentflow config show --set search.rounds=2",
    no_args_is_help=True,
    rich_markup_mode=None,
)
commands.add_typer(config_commands, name="config")


@config_commands.command(
    "show", epilog="Example: agentflow config show --set search.rounds=2 --set wall.height=0"
)
def show_config(config: Config = None, settings: Settings = None, as_json: Json = False) -> None:
    """Print the configuration of a run and the source of each value.

    Sources: default, file, --set, environment. The output is itself a configuration file.
    """
    from agentflow.app.configuration import annotated_yaml, resolve_config

    found = resolve_config(config, settings or ())
    if as_json:
        print_json(found)
    else:
        print(annotated_yaml(found))


@commands.command(epilog="Example: agentflow runs runs")
def runs(
    folder: Annotated[Path, typer.Argument(help="Directory of run directories.")] = Path("runs"),
    as_json: Json = False,
) -> None:
    """List runs with task, workflow, model, score, cost and state.

    States: done, running, stopped (resume it with `design --resume`), damaged.
    """
    from agentflow.app.inspect.overview import run_list
    from agentflow.cli.display.show_records import show_runs

    found = run_list(folder)
    if as_json:
        print_json(list(found))
    else:
        show_runs(found)


@commands.command(epilog="Example: agentflow show runs/recorded-throwing")
def show(run: Run, as_json: Json = False) -> None:
    """Show one run: stages, best machine, cost and failures."""
    from agentflow.app.inspect.overview import run_details
    from agentflow.cli.display.show_records import show_run

    found = run_details(run)
    if as_json:
        print_json(found)
    else:
        show_run(found)


@commands.command(epilog="Example: agentflow rescore runs/recorded-throwing")
def rescore(
    run: Run,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Worker processes; default: as in the run.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Simulate the machines of a run again and list the differences.

    The run itself is not changed.
    """
    from agentflow.app.inspect.rescore import rescore as simulate_again
    from agentflow.cli.display.show_records import show_rescored

    found = simulate_again(run, workers)
    if as_json:
        print_json(found)
    else:
        show_rescored(found)


@commands.command(epilog="Example: agentflow failures runs/recorded-throwing")
def failures(
    source: Annotated[Path, typer.Argument(help="Run directory, or directory of runs or sweeps.")],
    as_json: Json = False,
) -> None:
    """Count failures of replies and machines, each kind by a fixed rule.

    A refused reply counts as exactly one kind. An accepted reply can only count as `rationale
    not followed`. A machine is counted once per kind, however often it was simulated.

    \b
    Format of the reply
      unparsable         the reply is empty, cut off or not in the required format
    Planning: the wrong thing was planned
      missing component  a machine or blueprint has too few or too many of a required block
      plan not followed  a design changes or drops given blocks, adds none, or uses a type
                         that its part of the blueprint does not list; or a blueprint
                         contradicts itself
      rationale not followed
                         an accepted machine has fewer blocks of a type than its rationale
                         counts by name ("four Small Wheels"); nothing else in the rationale
                         is checked
      block not allowed  a block type is unknown or not allowed in the task
      no motion          (machines) no block moves more than 0.1 m after power comes on; not
                         counted for gearing, where cogs turn in place
    Construction: the machine was put together wrongly
      wrong facing       (machines) the axle of a powered wheel is not along x in a driving
                         task, or a loaded container does not open upwards
      wrong attachment   a block is attached to a parent or face that does not exist, is
                         occupied or comes later, has an impossible rotation, or is
                         two-ended with one parent
      overlap            two blocks overlap
      refused edit       an edit cannot be read or carried out for another reason
      breakage           (machines) a connection broke in the simulation
      other              anything else, such as the machine's size or the order of its ids
    """
    from agentflow.app.inspect.failures import count_failures
    from agentflow.cli.display.show_records import show_failures

    found = count_failures(source)
    if as_json:
        print_json(found)
    else:
        show_failures(found)

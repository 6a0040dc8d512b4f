"""The commands on what has been kept: runs, show, rescore, failures, and the configuration.

Importing it adds them to the others.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli.root import Config, Json, Run, Settings, commands, print_json

config_commands = typer.Typer(
    help="Look at configurations.",
    epilog="Example: agentflow config show --set search.rounds=2",
    no_args_is_help=True,
    rich_markup_mode=None,
)
commands.add_typer(config_commands, name="config")


@config_commands.command(
    "show", epilog="Example: agentflow config show --set search.rounds=2 --set wall.height=0"
)
def show_config(config: Config = None, settings: Settings = None, as_json: Json = False) -> None:
    """Print the configuration of a run, and of every value where it came from.

    Default, file, --set or environment; what is printed is a configuration file itself.
    """
    from agentflow.app.configuration import as_yaml, resolved

    found = resolved(config, settings or ())
    if as_json:
        print_json(found)
    else:
        print(as_yaml(found))


@commands.command(epilog="Example: agentflow runs runs")
def runs(
    folder: Annotated[Path, typer.Argument(help="Folder that holds run directories.")] = Path(
        "runs"
    ),
    as_json: Json = False,
) -> None:
    """List runs: task, workflow, model, score, cost, and whether they are done.

    States: done, running, stopped (continue with `design --resume`), damaged.
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
    """Show one run: its stages, its best machine, what it cost, and what went wrong."""
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
        int | None, typer.Option(min=1, help="Processes; by default as the run had.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Simulate the machines of a run in today's environment, and table what differs.

    Nothing in the run is changed.
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
    source: Annotated[Path, typer.Argument(help="Run directory, or folder of runs or sweeps.")],
    as_json: Json = False,
) -> None:
    """Count what went wrong, by one rule for each kind of failure.

    A refused reply is of one kind alone, and an accepted one of `rationale not followed` at
    most; a simulated machine, counted once, may be of several.

    \b
    Format, of replies
      unparsable         the reply is empty, cut off, or lacks the demanded format
    Planning: what was to be built is wrong
      missing component  a machine or blueprint lacks, or has too many of, a block that the
                         task demands
      plan not followed  a design changes or drops given blocks, adds none, or uses a type
                         that its part of the blueprint does not list; a blueprint
                         contradicts itself
      rationale not followed
                         an accepted design of a whole machine has fewer blocks of a type than
                         its own rationale counts by name ("four Small Wheels"); nothing else
                         that a rationale says is judged
      block not allowed  a block type is unknown or not in the task's list
      no motion          (machines) no block gets farther than 0.1 m from where it was when
                         power came on; not counted in gearing, where cogs turn in
                         place
    Construction: it was put together wrongly
      wrong facing       (machines) a powered wheel whose axle is not along x where the task
                         is to drive, or a container that holds something and does not open
                         upwards
      wrong attachment   a block hangs on a face or parent that does not exist, is taken, or
                         comes later, has a rotation that no attachment gives, or is
                         two-ended with one parent
      overlap            two blocks of the machine overlap
      refused edit       a refinement is refused for another reason: a command that cannot be
                         read or carried out
      breakage           (machines) a connection gave way in the simulation
      other              refused for anything else, such as the size of the machine or the
                         order of its ids
    """
    from agentflow.app.inspect.failures import count_failures
    from agentflow.cli.display.show_records import show_failures

    found = count_failures(source)
    if as_json:
        print_json(found)
    else:
        show_failures(found)

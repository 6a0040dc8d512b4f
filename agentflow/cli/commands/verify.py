"""The command verify. Importing this module registers it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli.commands.machines import Seed, Task, named_task
from agentflow.cli.root import Engine, Json, Knobs, commands, print_result


@commands.command(epilog="Example: agentflow verify examples/car.json --task movement")
def verify(
    source: Annotated[
        str, typer.Argument(help="Machine file, - for standard input, or run directory.")
    ],
    task: Task = None,
    knobs: Knobs = None,
    engine: Engine = None,
    seed: Seed = 0,
    workers: Annotated[int, typer.Option(min=1, help="Worker processes for simulation.")] = 2,
    as_json: Json = False,
) -> None:
    """Check whether a score holds when the simulation changes a little.

    The machine is simulated with the default physics, with time steps a quarter as long, and with
    masses, friction and motor torque changed by +2 % and -2 %, one at a time. The verified score is
    the median of the eight scores.

    A run stands for its best machine. Without --task, the run's own task, knobs and seed are used,
    and the result is stored in the run unless it has one already.
    """
    from agentflow.cli.display.live import print_line
    from agentflow.cli.display.show_verified import show_verified

    name = named_task(source, task, knobs, seed, engine)
    if name is None:
        from agentflow.app.inspect.verify import verify_run

        found = verify_run(Path(source), workers, lambda line: print_line(f"agentflow: {line}"))
    else:
        from agentflow.app.machines.files import machine_text
        from agentflow.app.machines.verify import verify_text
        from agentflow.app.tasks import find_task

        level = find_task(name, knobs or (), engine)
        found = verify_text(machine_text(source), level, seed=seed, workers=workers)
    print_result(found, as_json, show_verified)

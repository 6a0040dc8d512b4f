"""The command perturb. Importing this module registers it."""

from __future__ import annotations

from typing import Annotated

import typer

from agentflow.cli.commands.machines import Seed, Source
from agentflow.cli.root import Engine, Json, Knobs, commands, print_result


@commands.command(epilog="Example: agentflow perturb examples/car.json --task movement --n 20")
def perturb(
    source: Source,
    task: Annotated[str, typer.Option(help="Task, such as throwing or movement/3.")],
    knobs: Knobs = None,
    engine: Engine = None,
    count: Annotated[
        int, typer.Option("--n", min=0, help="Neighbours to simulate, drawn at random; 0: none.")
    ] = 100,
    every: Annotated[bool, typer.Option("--all", help="Simulate all neighbours.")] = False,
    seed: Seed = 0,
    workers: Annotated[int, typer.Option(min=1, help="Worker processes for simulation.")] = 2,
    as_json: Json = False,
) -> None:
    """Measure how robust a design is: change its world, and change the design by one edit.

    The world: masses, friction, motor speed and strength of connections changed by +10 % and
    -10 %, one at a time, and time steps half as long. The robust score is the 10 % quantile of
    these scores and the plain one; scores on other engines are shown beside it.

    The design: its neighbours are all legal machines one edit away. Blocks and faces whose edits
    lower the score most are the most sensitive.
    """
    from agentflow.app.machines.files import machine_text
    from agentflow.app.machines.perturb import perturb_text
    from agentflow.app.tasks import find_task
    from agentflow.cli.display.show_perturbed import show_perturbed
    from agentflow.cli.display.text import show_count

    found = perturb_text(
        machine_text(source),
        find_task(task, knobs or (), engine),
        count=None if every else count,
        seed=seed,
        workers=workers,
        say=show_count("simulation"),
    )
    print_result(found, as_json, show_perturbed)

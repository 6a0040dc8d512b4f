"""Commands that try scores again: verify, robustness, engines. Importing this module registers
them."""

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli import options
from agentflow.cli.root import commands, print_result


@commands.command(epilog="Example: agentflow robustness examples/car.json --task movement --n 20")
def robustness(
    source: options.MachineOrRun,
    task: options.Task = None,
    knobs: options.Knobs = None,
    engine: options.Engine = None,
    count: Annotated[int, typer.Option("--n", min=0)] = 100,
    every: Annotated[bool, typer.Option("--all")] = False,
    seed: options.Seed = 0,
    workers: options.Workers = 2,
    out: Path | None = None,
    as_json: options.Json = False,
) -> None:
    """Measure how robust a design is: change its world, and change the design by one edit.

    The world: masses, friction, motor speed and strength of connections changed by +10 % and
    -10 %, one at a time, and time steps half as long. The robust score is the 10 % quantile of
    these scores and the plain one; scores on other engines are also shown.

    The design: its neighbours are all legal machines one edit away. Blocks and faces whose edits
    lower the score most are the most sensitive.

    For a run, its best machine is used. Without --task, the run's own task, knobs and seed are
    used, and the result is kept in the run, whose report then shows it.

    Args:
        count: Neighbours to simulate, drawn at random; 0: none.
        every: Simulate all neighbours.
        out: Also write an HTML page with a figure to this file.
    """
    from agentflow.app.pages.robustness import page_writer
    from agentflow.app.subjects.robustness import measure_robustness
    from agentflow.app.subjects.subject import resolve
    from agentflow.cli.display.show_scores import show_robustness
    from agentflow.cli.display.text import show_count

    subject = resolve(source, task, knobs, seed, engine)
    write = None if out is None else page_writer(out)
    number, say = None if every else count, show_count("simulation")
    found = measure_robustness(subject, count=number, workers=workers, say=say)
    if write is not None and not found["problems"]:
        write(found)
    print_result(found, as_json, show_robustness)


@commands.command(epilog="Example: agentflow verify examples/car.json --task movement")
def verify(
    source: str,
    task: options.Task = None,
    knobs: options.Knobs = None,
    engine: options.Engine = None,
    seed: options.Seed = 0,
    workers: options.Workers = 2,
    as_json: options.Json = False,
) -> None:
    """Check whether a score holds when the simulation changes a little.

    The machine is simulated with the default physics, with time steps a quarter as long, and with
    one quantity at a time changed by +2 % and -2 %: masses, friction, motor torque, thrust, pull of
    springs and winches, and start times, as far as that changes anything. The verified score is the
    median of the scores. It holds where a score is above 0 and at least half of the median; a
    machine whose score holds in some simulations but not in all is called fragile.

    For a run, its best machine is used. Without --task, the run's own task, knobs and seed are
    used, and the result is stored in the run unless it has one already.

    Args:
        source: Machine file, - for standard input, or run directory.
    """
    from agentflow.app.subjects.subject import resolve
    from agentflow.app.subjects.verify import verify as simulate_again
    from agentflow.cli.display.live import print_remark
    from agentflow.cli.display.show_scores import show_verified

    subject = resolve(source, task, knobs, seed, engine)
    print_result(simulate_again(subject, workers, print_remark), as_json, show_verified)


@commands.command(epilog="Example: agentflow engines --machines 200")
def engines(
    machines: Annotated[int, typer.Option(min=0)] = 20,
    workers: options.Workers = 2,
    as_json: options.Json = False,
) -> None:
    """Compare the installed physics engines.

    The best known machine of every level is simulated on each engine: score, first connection to
    break, difference. Then machines of the procedural model are ranked by their scores on each
    engine. The rank correlation (Spearman's) is 1 if both rank them alike, and 0 if one ranking
    says nothing about the other.

    Args:
        machines: Machines of the procedural model per family, to rank.
    """
    from agentflow.app.subjects.engines import compare_engines
    from agentflow.cli.display.show_scores import show_engines
    from agentflow.cli.display.text import show_count

    found = compare_engines(machines, workers, show_count("simulation"))
    print_result(found, as_json, show_engines)

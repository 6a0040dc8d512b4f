"""The command verify. Importing this module registers it."""

from __future__ import annotations

from agentflow.cli import options
from agentflow.cli.root import commands, print_result


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

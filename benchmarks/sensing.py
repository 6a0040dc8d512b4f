"""What sensors and laws cost: their share of the CPU time of rollouts of machines that sense.

    python benchmarks/sensing.py [--repeats 8]

Counts everything that happens because a machine senses: readings, laws, and setting motors. Each
figure is from the fastest of several rollouts; the wanted share is 3 %.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

from controllers import COMPARISONS, ENGINES

from agentflow.env.physics.engines import choose_engine
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.trial import Trial
from agentflow.env.tasks.registry import get_task

CLOCKS = 20_000


def main() -> None:
    """Print one line for each machine and engine."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=8)
    repeats = parser.parse_args().repeats
    spent: list[float] = []
    fly = Trial._fly

    def timed(self: Trial, *arguments: Any) -> None:
        began = time.thread_time()
        fly(self, *arguments)
        spent.append(time.thread_time() - began)

    Trial._fly = timed  # type: ignore[method-assign]
    began = time.thread_time()
    for _ in range(CLOCKS):
        time.thread_time()
    clock = (time.thread_time() - began) / CLOCKS
    for comparison in COMPARISONS:
        for name in ENGINES:
            engine = choose_engine(name).start()
            task = get_task(comparison.task, engine=name).trials(0)[0]
            found = []
            for _ in range(repeats):
                spent.clear()
                began = time.thread_time()
                simulate(comparison.sensing(), task, engine=engine)
                found.append((time.thread_time() - began, sum(spent) - clock * len(spent)))
            whole, own = min(found)
            told = f"{1e3 * own:.1f} of {1e3 * whole:.0f} ms, {own / whole:.1%}"
            print(f"{comparison.title}, {name}: {told}, {len(spent)} readings", flush=True)
            engine.close()


if __name__ == "__main__":
    main()

"""What sensors and laws cost: their share of the CPU time of rollouts of machines that sense.

    python benchmarks/sensing.py [--pairs 15]

Each pair is the same rollout twice, in one process: once with controllers, and once with the levels
that they gave, noted beforehand, so that both set the same motors and have the same digest. The
difference is what sensors and laws cost, and what feedback tells of them. Medians of pairs; the
wanted share is 3 %. Engines that take compiled steps after a number of rollouts are measured both
without and with.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from statistics import median, quantiles
from typing import Any

from controllers import COMPARISONS, ENGINES, Comparison

from agentflow.env.controllers.pilot import Pilot
from agentflow.env.physics.engine import Engine
from agentflow.env.physics.engines import choose_engine
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.trial import Trial
from agentflow.env.tasks.registry import get_task

MAKE: Any = Trial._make_pilot


class Noted:
    """Notes what a pilot says, or says it again without sensing."""

    def __init__(self, pilot: Pilot) -> None:
        self.pilot, self.decouplers, self.said = pilot, pilot.decouplers, list[Any]()
        self.samples, self.sudden, self.again = list[Any](), False, iter(())

    def __call__(self, when: float) -> Any:
        changes, self.sudden = next(self.again, None) or self._note(when)
        return changes

    def _note(self, when: float) -> Any:
        self.said.append((dict(self.pilot(when)), self.pilot.sudden))
        return self.said[-1]

    def lose(self, *what: Any) -> None:
        self.pilot.lose(*what)


def differences(comparison: Comparison, engine: Engine, pairs: int) -> Iterator[tuple[float, ...]]:
    """CPU time with controllers, and how much less the same takes without, s."""
    task = get_task(comparison.task, engine=engine.identity.name).trials(0)[0]
    machine, digests, noted = comparison.sensing(), set[str | None](), list[Noted]()

    def rollout(make: Any) -> float:
        Trial._make_pilot = make  # type: ignore[method-assign]
        began = time.thread_time()
        digests.add(simulate(machine, task, engine=engine).digest)
        return time.thread_time() - began

    def note(trial: Trial, variation: Any) -> Noted:
        noted.append(Noted(MAKE(trial, variation)))
        return noted[0]

    def repeat(*_: Any) -> Noted:
        noted[0].again = iter(noted[0].said)
        return noted[0]

    rollout(note)
    for pair in range(pairs):
        makes = (MAKE, repeat) if pair % 2 else (repeat, MAKE)
        spent = {make: rollout(make) for make in makes}
        yield spent[MAKE], spent[MAKE] - spent[repeat]
    assert len(digests) == 1, digests


def main() -> None:
    """Print one line for each machine and engine."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--pairs", type=int, default=15)
    pairs = parser.parse_args().pairs
    for comparison in COMPARISONS:
        for name, compiled in ((name, some) for name in ENGINES for some in (False, True)):
            engine: Any = choose_engine(name).start()
            if not hasattr(engine, "patience") and compiled:
                continue
            engine.patience = 0 if compiled else 1_000_000
            wholes, found = zip(*differences(comparison, engine, pairs), strict=True)
            share = median(found) / median(wholes)
            low, _, high = quantiles(found, n=4)
            told = f"{1e3 * median(found):.1f} [{1e3 * low:.1f}, {1e3 * high:.1f}]"
            whole = f"{1e3 * median(wholes):.0f} ms, {share:.1%}"
            print(
                f"{comparison.title}, {name}{' compiled' * compiled}: {told} of {whole}", flush=True
            )
            engine.close()


if __name__ == "__main__":
    main()

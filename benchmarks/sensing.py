"""What sensors and laws cost: their share of the CPU time of rollouts of machines that sense.

    python benchmarks/sensing.py [--pairs 15]

Calls of the pilot, making it and telling what it did are timed by themselves in some rollouts:
medians of wall time. As this leaves out what they do to the caches of all else, pairs of rollouts
are compared as well, which needs a quiet core: the same rollout twice, in one process, once with
controllers, and once with the levels that they gave, noted beforehand, so that both set the same
motors and have the same digest. Of their differences, medians and quartiles; the wanted share is
3 %. Engines that take compiled steps after a number of rollouts are measured both without and with.
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
from agentflow.env.simulation import trial
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.trial import Trial
from agentflow.env.tasks.registry import get_task

SPENT: dict[str, list[float]] = {"call": [], "make": [], "tell": []}
"""Times of calls, s."""


def timed(function: Any, name: str) -> Any:
    """The function, whose times are noted."""

    def call(*given: Any) -> Any:
        began = time.perf_counter()
        found = function(*given)
        if name != "tell" or given[1].samples:
            SPENT[name].append(time.perf_counter() - began)
        return found

    return call


MAKE: Any = Trial._make_pilot
TELL = trial.tell_controllers
TIMED = 3
"""Rollouts in which these are timed; timing them in pairs would add to what they take."""


def watch(on: bool) -> None:
    """Time calls of the pilot, making it and telling what it did, or stop it."""
    make = timed(MAKE, "make")

    def made(*given: Any) -> Pilot:
        pilot: Pilot = make(*given)
        pilot.fly = timed(pilot.fly, "call")
        return pilot

    Trial._make_pilot = made if on else MAKE  # type: ignore[method-assign]
    trial.tell_controllers = timed(TELL, "tell") if on else TELL


class Noted:
    """Notes what a pilot says, or says it again without sensing."""

    def __init__(self, pilot: Pilot) -> None:
        self.pilot, self.decouplers, self.said = pilot, pilot.decouplers, list[Any]()
        self.samples, self.changes, self.again = list[Any](), dict[Any, float](), iter(())

    def fly(self, when: float) -> bool:
        sudden, self.changes = next(self.again, None) or self._note(when)
        return bool(sudden)

    def _note(self, when: float) -> Any:
        self.said.append((self.pilot.fly(when), dict(self.pilot.changes)))
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

    watch(True)
    for _ in range(TIMED):
        simulate(machine, task, engine=engine)
    watch(False)
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
            for spent in SPENT.values():
                spent.clear()
            wholes, found = zip(*differences(comparison, engine, pairs), strict=True)
            calls = len(SPENT["call"]) / len(SPENT["make"])
            own = calls * median(SPENT["call"]) + median(SPENT["make"]) + median(SPENT["tell"])
            whole, pair = median(wholes), median(found)
            low, _, high = (1e3 * each for each in quantiles(found, n=4))
            print(
                f"{comparison.title}, {name}{' compiled' * compiled}: {1e3 * own:.1f} ms of "
                f"{1e3 * whole:.0f}, {own / whole:.1%}; pairs {1e3 * pair:.1f} "
                f"[{low:.1f}, {high:.1f}] ms, {pair / whole:.1%}",
                flush=True,
            )
            engine.close()


if __name__ == "__main__":
    main()

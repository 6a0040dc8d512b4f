"""Compares the simulation with published measurements of the reference environment.

    python benchmarks/fidelity.py [--engine auto] [--catapults 200] [--seed 0]

Covers the one throw that is published in full, the plain car, and the distances that random valid
catapults throw. The last has no published counterpart; it shows the range of scores.
"""

from __future__ import annotations

import argparse
from collections import Counter
from random import Random
from statistics import fmean, median, pstdev

from cars import PLAIN_CAR
from catapults import catapult
from published import (
    BEFORE_BREAK,
    BOULDER,
    LAST,
    ROTOR,
    TOWER_TOP,
    facts,
    machines,
    misfit,
    samples,
    throw,
)

from agentflow.env.constants import constants
from agentflow.env.physics.engine import AUTO, Engine
from agentflow.env.physics.engines import choose_engine
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--catapults", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--engine", default=AUTO)
    options = parser.parse_args()
    engine = choose_engine(options.engine).start()
    print(f"{engine.identity}, constants {constants().digest}")
    found = {name: throw(machine, 5.0, engine) for name, machine in machines().items()}
    _paths(found)
    _misfits(found)
    _tower(found)
    _car(engine)
    _spread(engine, options.catapults, Random(options.seed))
    engine.close()


def _paths(found: dict[str, Rollout]) -> None:
    """Positions sample by sample."""
    data = facts()
    for title, block, name, last in (
        ("boulder origin, m", BOULDER, "boulder", LAST),
        ("rotating block origin, m", ROTOR, "rotor_position", BEFORE_BREAK),
    ):
        print(f"\n{title:26s} {'published':>22s}" + "".join(f"{each:>26s}" for each in found))
        for sample in range(last + 1):
            row = [data[name][sample]]
            traces = [each.trace for each in found.values() if each.trace]
            row += [samples(trace.position)[sample, block] for trace in traces]
            cells = (" ".join(f"{value:6.2f}" for value in point) for point in row)
            print(
                f"  t = {sample * data['interval']:.1f} s".ljust(26), *(f"{c:>25s}" for c in cells)
            )


def _misfits(found: dict[str, Rollout]) -> None:
    print("\nrms differences from it" + " " * 26 + "".join(f"{each:>26s}" for each in found))
    each = {name: misfit(rollout) for name, rollout in found.items()}
    for title, field in (
        ("boulder, 0 to 0.6 s, m per coordinate", "boulder"),
        ("rotating block, 0.2 and 0.4 s, m", "rotor"),
        ("angle of rotating block and root, rad", "turn"),
        ("rotating block, 0.6 and 0.8 s (broken), m", "after"),
        ("block 8, sample closest to the published, m", "top_place"),
        ("the same, m/s", "top_speed"),
    ):
        print(f"  {title:47s}" + "".join(f"{getattr(one, field):26.2f}" for one in each.values()))
    first = facts()["first_break"]
    broken = [f"block {r.broken[0].block} at {r.broken[0].time:.2f} s" for r in found.values()]
    print(
        f"first break (block {first['block']} at {first['time']} s)".ljust(49)
        + "".join(f"{text:>26s}" for text in broken)
    )
    for title, key, published in (
        ("greatest height, m", "height", facts()["greatest_height"]),
        ("greatest reach, m", "reach", facts()["distance"]),
    ):
        cells = "".join(f"{float(r.terms[key] or 0):26.2f}" for r in found.values())
        print(f"{title} ({published} at landing)".ljust(49) + cells)


def _tower(found: dict[str, Rollout]) -> None:
    """The top of the tower; its only published sample was taken within the first 0.2 s."""
    only, rate = facts()["tower_top_first"], constants()["step_rate"]
    print(
        f"\nblock {TOWER_TOP}, its only published sample: at {only['position']} m, "
        f"velocity {only['velocity']} m/s"
    )
    print(f"{'  origin, m; velocity, m/s':26s}" + "".join(f"{each:>40s}" for each in found))
    for step in (0, 1, 2, 6, 12, 24, 48, 72):
        cells = ""
        for trace in (each.trace for each in found.values() if each.trace):
            at, speed = trace.position[step, TOWER_TOP], trace.velocity[step, TOWER_TOP]
            text = ";".join(" ".join(f"{value:5.2f}" for value in row) for row in (at, speed))
            cells += f"{text:>40s}"
        print(f"  t = {step / rate:.3f} s".ljust(26) + cells)


def _car(engine: Engine) -> None:
    low, high = facts()["plain_car_distance"]
    score = simulate(PLAIN_CAR, get_task("movement"), engine=engine).score
    print(f"\nplain car in 5 s: {score:.1f} m (best published {low} to {high} m)")


def _spread(engine: Engine, count: int, rng: Random) -> None:
    """Scores, breakage and results of random catapults."""
    task = get_task("throwing")
    found = [simulate(catapult(rng), task, engine=engine) for _ in range(count)]
    scores = sorted(float(each.score or 0.0) for each in found)
    thrown = [score for score in scores if score > 0]
    print(f"\n{count} random valid catapults: {dict(Counter(each.status for each in found))}")
    print(
        f"  thrown forwards {len(thrown)}; something broke in {sum(bool(r.broken) for r in found)}"
    )
    print(
        f"  score: mean {fmean(scores):.2f} m, standard deviation {pstdev(scores):.2f}, "
        f"90 % below {scores[int(0.9 * count)]:.2f}, greatest {scores[-1]:.2f}"
    )
    any_way = sorted(float(each.terms.get("distance_any") or 0.0) for each in found)
    print(f"  any direction: median {median(any_way):.2f} m, greatest {any_way[-1]:.2f} m")


if __name__ == "__main__":
    main()

"""Where the engines agree: scores, breaks and ranks of the same machines on both."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from cars import CAR
from figures import MUJOCO, PYBULLET, Figure, Options, engines, reach, run, shipped
from published import machines, misfit, throw
from shelf import families, load, read

from agentflow.app.subjects.engines import compare_engines
from agentflow.env.physics.engines import choose_engine
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_level, get_task
from agentflow.machine.tree import Machine

CARS = {"plain_car": 0.02, "framed_car": 0.02, "sprung_car": 0.02}
BIG_CAR, SPRING_ARM = 0.03, 0.04
"""Greatest relative differences of scores."""
FIRST, APART = 8, 0.02
"""The block that breaks first, and how many seconds the engines may be apart."""
THROWS = ("published_throw", "springy_throw", "unballasted_throw")
WINDOW, BOULDER = 1.0, 0.55
"""s, m: greatest root mean square of the published boulder's path over 0.6 s."""
HALF, IDLE = 0.5, 0.02
"""Shares of a good score: what references reach, and what contacts may move."""
RANKS = 0.9
RATES, NEAR = (120.0, 480.0), 0.03
STEADY = {
    "plain_car": shipped("plain_car"),
    "framed_car": shipped("framed_car"),
    "sprung_car": shipped("sprung_car"),
    "car of 20 blocks": CAR,
    "thrower_short_arm": shipped("thrower_short_arm"),
    "thrower_long_arm": shipped("thrower_long_arm"),
    "springy_throw": shipped("springy_throw"),
    "spring_arm": shipped("throwing/spring_arm"),
}
"""Machines simulated at several rates."""


def agreement(options: Options) -> Iterator[Figure]:
    """Scores of cars and throwers, and first breaks."""
    del options
    both = engines()

    def compare(machine: Machine) -> dict[str, Rollout]:
        return {name: run(machine, engine) for name, engine in both.items()}

    cars = {name: (shipped(name), limit) for name, limit in CARS.items()}
    cars["car of 20 blocks"] = CAR, BIG_CAR
    cars["throw with springs"] = shipped("throwing/spring_arm"), SPRING_ARM
    for name, (machine, limit) in cars.items():
        found = {engine: reach(rollout) for engine, rollout in compare(machine).items()}
        off = abs(found[MUJOCO] / found[PYBULLET] - 1.0)
        told = f"{found[MUJOCO]:.2f} against {found[PYBULLET]:.2f} m: {100 * off:.1f} %"
        yield Figure(f"score, {name}", told, f"{100 * limit:g} %", off <= limit)
    for name in THROWS:
        first = {
            engine: rollout.broken[0] if rollout.broken else None
            for engine, rollout in compare(shipped(name)).items()
        }
        mine, theirs = first[MUJOCO], first[PYBULLET]
        met = bool(mine and theirs and mine.block == theirs.block == FIRST)
        met = met and bool(mine and theirs and abs(mine.time - theirs.time) <= APART)
        told = " against ".join(
            f"block {each.block} at {each.time:.3f} s" if each else "none"
            for each in (mine, theirs)
        )
        limit = f"block {FIRST}, {1e3 * APART:g} ms"
        yield Figure(f"first break, {name}", told, limit, met)


def fidelity(options: Options) -> Iterator[Figure]:
    """The published boulder's path."""
    del options
    both = engines()
    for name, machine in machines().items():
        off = {
            label: misfit(throw(machine, WINDOW, engine)).boulder for label, engine in both.items()
        }
        told = f"{off[MUJOCO]:.2f} m; PyBullet {off[PYBULLET]:.2f} m"
        counts = name != "printed blocks"  # without its ballast the machine is another one
        yield Figure(
            f"published boulder, rms over 0.6 s, {name}",
            told,
            f"{BOULDER:g} m" if counts else "",
            not counts or off[MUJOCO] <= BOULDER,
        )


def references(options: Options) -> Iterator[Figure]:
    """Every reference machine on its level."""
    del options
    engine = choose_engine(MUJOCO).start()
    for family in families():
        for item in read(family).references:
            rollout = run(load(item.machine), engine, item.level)
            good = get_level(item.level).file.good
            score = rollout.score or 0.0
            told = f"{score:.2f} ({score / good:.0%} of good), PyBullet {item.score:.2f}"
            met = score >= HALF * good
            yield Figure(f"{item.level}: {item.machine}", told, f"{HALF * good:g}", met)


def cheats(options: Options) -> Iterator[Figure]:
    """Cheats, and references without power, earn nothing."""
    del options
    engine = choose_engine(MUJOCO).start()
    earning, count, idle, off = [], 0, [], 0
    for shelf in map(read, families()):
        for cheat in shelf.cheats:
            for level in cheat.levels:
                count += 1
                score = run(load(cheat.machine), engine, level).score or 0.0
                if score > max(cheat.most, IDLE * get_level(level).file.good):
                    earning.append(f"{cheat.machine} on {level} {score:.3f}")
        for item in shelf.references:
            off += 1
            rollout = simulate(load(item.machine), get_task(item.level), engine=engine, power=False)
            if (rollout.score or 0.0) > IDLE * get_level(item.level).file.good:
                idle.append(f"{item.machine} on {item.level} {rollout.score:.3f}")
    told = "; ".join([f"{len(earning)} of {count}", *earning])
    yield Figure("cheats that earn something", told, "0", not earning)
    told = "; ".join([f"{len(idle)} of {off}", *idle])
    yield Figure("references that earn something with power off", told, "0", not idle)


def ranking(options: Options) -> Iterator[Figure]:
    """Ranks of procedural machines of each family."""

    def tell(done: int, total: int) -> None:
        if done % 100 == 0:
            print(f"{done} of {total}", file=sys.stderr, flush=True)

    for found in compare_engines(options.machines, options.workers, tell)["families"]:
        (correlation,) = found["correlations"]
        told = f"{correlation:.3f}" if correlation is not None else "undefined"
        what = f"Spearman, {found['machines']} procedural machines, {found['family']}"
        yield Figure(what, told, f"{RANKS:g}", correlation is not None and correlation >= RANKS)


def convergence(options: Options) -> Iterator[Figure]:
    """Scores at the usual rate against those at four times that."""
    del options
    engine = choose_engine(MUJOCO).start()
    for name, machine in STEADY.items():
        usual, fine = (run(machine, engine, rate=rate) for rate in RATES)
        off = abs(reach(usual) / reach(fine) - 1.0)
        breaks = "; something broke" if usual.broken or fine.broken else ""
        told = f"{reach(usual):.2f} against {reach(fine):.2f} m: {100 * off:.1f} %{breaks}"
        met = bool(breaks) or off <= NEAR
        yield Figure(f"120 against 480 Hz, {name}", told, f"{100 * NEAR:g} %", met)

"""How exact, repeatable and sound an engine is: MuJoCo's figures, which need no other engine."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import io
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
from cars import CAR
from figures import MUJOCO, Figure, Options, level_of, run, shipped
from stress import cases, stress

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import World
from agentflow.env.physics.engines import choose_engine
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.structure.spanning_tree import Skeleton, skeleton
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine

SPLIT_MOST, MOMENTUM_MOST, STACK_MOST = 6.0, 1e-10, 0.01
"""ms; relative; relative."""
REPEATED = 60
"""Random machines whose digests are compared over processes."""
FLAT = 2.0
"""MB by which memory may grow after the first tenth of the rollouts."""


def splits(options: Options) -> Iterator[Figure]:
    """Split a machine in motion."""
    machine = shipped("throwing/spring_arm")
    times, changes = [], []
    for _ in range(options.repeats):
        world, assembly = _start(machine)
        for _ in range(60):
            world.step()
        for entry in ("motors", "springs"):
            world.switch(entry, 1.0)
        for _ in range(45):
            world.step()
        rigid = [i for i, joint in enumerate(assembly.joints) if joint.kind == "fixed"]
        before = {name: np.array(value) for name, value in world.momentum().items()}
        began = time.process_time()
        world.split([rigid[len(rigid) // 2]])
        times.append(1e3 * (time.process_time() - began))
        after = world.momentum()
        changes += [
            np.abs(np.asarray(after[name]) - value).max() / np.abs(value).max()
            for name, value in before.items()
        ]
    least, most = min(times), float(max(changes))
    what = f"split of {len(assembly.parts)} parts"
    yield Figure(what, f"{least:.1f} ms", f"{SPLIT_MOST:g} ms", least <= SPLIT_MOST)
    limit = f"{MOMENTUM_MOST:g}"
    yield Figure("change of momentum and energy", f"{most:.1e}", limit, most <= MOMENTUM_MOST)


def stacks(options: Options) -> Iterator[Figure]:
    """At rest every connection bears the weight of what stands on it alone."""
    del options
    worst = 0.0
    for machine in (CAR, shipped("mast_car"), shipped("published_throw")):
        world, assembly = _start(machine)
        for _ in range(480):
            world.step()
        total = np.zeros_like(world.reactions)
        for _ in range(60):
            world.step()
            total += world.reactions
        plan = skeleton(len(assembly.parts), assembly.joints)
        grounded = {touch.a for touch in world.contacts()} | {t.b for t in world.contacts()}
        for joint, weight in _weights(assembly, plan, grounded):
            across = total[joint, :3] / 60
            share = np.linalg.norm(np.abs(across) - (0.0, weight, 0.0)) / weight
            worst = max(worst, float(share))
    yield Figure(
        "forces in static stacks, error relative to the weight above",
        f"{100 * worst:.2f} %",
        f"{100 * STACK_MOST:g} %",
        worst <= STACK_MOST,
    )


def _weights(
    assembly: Assembly, plan: Skeleton, grounded: set[int | str]
) -> Iterator[tuple[int, float]]:
    """Joints of the tree beyond which nothing touches anything, and the weight there, N."""
    loops = {*plan.redundant, *(loop.joint for loop in plan.loops)}
    for piece in plan.pieces if not loops else ():
        for link in piece.links:
            beyond = {link.part}
            for other in piece.links:  # parents come before children
                if other.parent in beyond:
                    beyond.add(other.part)
            if not any(assembly.parts[part].block in grounded for part in beyond):
                mass = sum(assembly.parts[part].mass for part in beyond)
                yield link.joint, constants()["gravity"] * mass


def _start(machine: Machine) -> tuple[World, Assembly]:
    assembly = assemble(machine, place(machine), constants())
    scene = get_task(level_of(machine)).scene(machine)
    engine = choose_engine(MUJOCO).start()
    return engine.build(assembly, scene, constants()["step_rate"]), assembly


# --- repeatable ----------------------------------------------------------------------------


def determinism(options: Options) -> Iterator[Figure]:
    """Digests of random machines on all tasks in two processes, in opposite orders."""
    del options
    found = [_digests_elsewhere(order) for order in ("forwards", "backwards")]
    same = sum(found[0][name] == found[1][name] for name in found[0])
    value = f"{same} of {REPEATED}"
    yield Figure("equal digests in two processes", value, "all", same == REPEATED)


def _digests_elsewhere(order: str) -> dict[str, str]:
    script = f"import json, exact; print(json.dumps(exact.digests({order == 'backwards'})))"
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        check=True,
        cwd=Path(__file__).parent,
    )
    found: dict[str, str] = json.loads(done.stdout)
    return found


def digests(backwards: bool) -> dict[str, str | None]:
    """Digest of the rollout of each of the random machines, simulated in this or that order."""
    engine = choose_engine(MUJOCO).start()
    chosen = list(islice(cases(REPEATED), REPEATED))
    ordered = chosen[::-1] if backwards else chosen
    return {name: simulate(tree, task, engine=engine).digest for name, task, tree in ordered}


# --- sound ---------------------------------------------------------------------------------


def memory(options: Options) -> Iterator[Figure]:
    """Memory of this process during many short rollouts of a machine that breaks."""
    engine, machine = choose_engine(MUJOCO).start(), shipped("published_throw")
    task = get_task("throwing", {"window": 1})
    start = 0.0
    for done in range(options.rollouts):
        if done == options.rollouts // 10:
            start = _memory()
        simulate(machine, task, engine=engine)
    grown = _memory() - start
    what = f"growth of memory over {options.rollouts} rollouts"
    yield Figure(what, f"{grown:.1f} MB of {start:.0f} MB", f"{FLAT:g} MB", grown <= FLAT)


def soundness(options: Options) -> Iterator[Figure]:
    """Random machines on all tasks: every result typed and finite."""
    told = io.StringIO()
    with contextlib.redirect_stdout(told):
        faults = stress(options.rollouts, options.workers, 0, MUJOCO)
    print(told.getvalue(), file=sys.stderr)
    what = f"faults of {options.rollouts} random machines on random tasks"
    yield Figure(what, str(faults), "0", not faults)
    engine = choose_engine(MUJOCO).start()
    before = run(CAR, engine).digest
    for _, task, machine in islice(cases(REPEATED, seed=1), REPEATED):
        simulate(machine, task, engine=engine)
    same = run(CAR, engine).digest == before
    yield Figure("a car after random machines", "the same bits" if same else "differs", "", same)


def _memory() -> float:
    """Resident memory of this process after freed memory went back to the system, MB."""
    gc.collect()
    ctypes.CDLL("libc.so.6").malloc_trim(0)
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmRSS:")) / 1024

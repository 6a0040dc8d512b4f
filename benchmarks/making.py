"""Machines as files of CAD programs and printers, parts lists and instructions, read back.

    PYTHONPATH=. .venv-cad/bin/python benchmarks/making.py [--random 50]

Takes all reference machines and cheats of tests/machines and random valid machines. For each it
compares volumes and centroids of the STEP file with the block library, looks whether the STL file
and every part of the 3MF file are watertight and whether two readers measure the same, counts the
parts list, tries pegs, and carries out the order of the instructions by the check of its tests.
Prints what is not as it should be, and the largest differences.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import numpy as np

from agentflow.errors import UsageError
from agentflow.machine import Machine, Problem, place, spatial_problems
from agentflow.machine.edits.random import random_machine
from agentflow.machine.geometry.pieces import build_order
from agentflow.making.guide import bill, steps_of
from agentflow.making.parts import Making, making
from agentflow.making.printing import machine_3mf, machine_stl
from agentflow.making.step import machine_step
from agentflow.making.usd import machine_usd
from tests.cad.reading import expected, read_3mf, read_mesh, read_step
from tests.machine.test_build_order import fits

MOST = 1e-3
"""Greatest relative difference of volumes, and distance of centroids in m."""
worst = {"volume": 0.0, "centroid": 0.0, "readers": 0.0}


def main() -> None:
    """Check all machines and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--random", type=int, default=50)
    count, started = parser.parse_args().random, time.monotonic()
    machines = {
        str(file): Machine.from_file(file)
        for file in sorted(Path("tests").glob("machines/**/*.json"))
    }
    machines |= {
        f"random {i}": random_machine(Random(f"made {i}"), size=(5, 30)) for i in range(count)
    }
    seen: Counter[str] = Counter()
    for name, machine in machines.items():
        if spatial_problems(place(machine)):
            seen["not valid"] += 1
            continue
        seen["machines"] += 1
        seen["blocks"] += len(machine)
        for fault in (*faults(machine, seen),):
            print(f"{name}: {fault}", flush=True)
    print(f"{dict(seen)}, {time.monotonic() - started:.0f} s")
    print({what: f"{value:.2g}" for what, value in worst.items()})


def faults(machine: Machine, seen: Counter[str]) -> Iterator[str]:
    """What is not as it should be, in words."""
    with TemporaryDirectory() as folder:
        bodies, _ = read_step(machine_step(machine, Making())[0], Path(folder), 1000)
    if len(bodies) != len(machine):
        yield f"the STEP file has {len(bodies)} blocks"
    for block, body in expected(machine).items():
        volume = abs(bodies[block].volume / body.volume - 1)
        centroid = float(np.abs(bodies[block].centre - body.centre).max())
        worst["volume"], worst["centroid"] = (
            max(worst["volume"], volume),
            max(worst["centroid"], centroid),
        )
        if max(volume, centroid) > MOST:
            yield f"{block} differs by {volume:.2g} in volume, its centre by {centroid:.2g} m"
    machine_usd(machine, Making())
    for settings in (Making(), making(parts=True)):
        [solid] = read_mesh(machine_stl(machine, settings)[0], "stl").values()
        if not solid.is_watertight:
            yield f"the STL file is not watertight ({settings})"
    data, _ = machine_3mf(machine, making(parts=True))
    meshes, volumes = read_mesh(data, "3mf"), read_3mf(data)
    for part, mesh in meshes.items():
        difference = abs(mesh.volume / volumes[part] - 1)
        worst["readers"] = max(worst["readers"], difference)
        if not mesh.is_watertight or difference > MOST:
            yield f"{part} of the 3MF file is not watertight, or two readers differ"
    listed: Counter[int] = Counter()
    for row in bill(machine):
        listed[row["type"]] += row["number"]
    if listed != Counter(step.type for step in machine):
        yield "the parts list is not the tree"
    geometry = place(machine)
    order = build_order(geometry)
    if isinstance(order, Problem):
        seen["cannot be built"] += 1
        return
    shown = [block for step in steps_of(order) for block in step]
    if sorted(shown) != list(range(len(machine))):
        yield "the instructions leave blocks out"
    for index, block in enumerate(shown):
        if not fits(geometry, block, frozenset(shown[:index])):
            yield f"block {block} does not fit in its step"
    try:
        machine_stl(machine, making(pegs="5mm"))
        seen["with pegs of 5 mm"] += 1
    except UsageError as error:
        seen["pegs refused"] += 1
        print(f"  {error}")


if __name__ == "__main__":
    main()

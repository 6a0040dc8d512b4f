"""The same machine, task and seed give the same bits: in any order, process, worker, company."""

from __future__ import annotations

import asyncio
import os
import random
import sys
from collections.abc import Mapping

import pytest

from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine.tree import Machine
from tests.env.machines import shipped
from tests.processes import run_python

CASES = {
    "breakage": ("published_throw", "throwing"),
    "springs and wind": ("springy_throw", "throwing/3"),
    "braces": ("braced_throw", "throwing"),
    "a loose rotor": ("rotor_with_ballast", "movement"),
    "bumps": ("mast_car", "movement/3"),
    "suspension": ("sprung_car", "movement"),
}


def case(name: str) -> tuple[Machine, Task]:
    machine, task = CASES[name]
    return shipped(machine), get_task(task, {"window": 1})


def digests(found: Mapping[str, Rollout]) -> dict[str, str | None]:
    return {name: rollout.digest for name, rollout in found.items()}


@pytest.fixture(scope="module")
def here() -> dict[str, Rollout]:
    return {name: simulate(*case(name)) for name in CASES}


@pytest.mark.slow
def test_the_cases_are_what_they_say(here: dict[str, Rollout]) -> None:
    assert {rollout.status for rollout in here.values()} == {"ok"}
    assert [name for name, rollout in here.items() if rollout.broken] == list(CASES)[:4]
    assert len(set(digests(here).values())) == len(CASES)
    sprung = here["springs and wind"].trace
    assert sprung is not None
    assert sprung.linear == (15, 16)
    assert sprung.even.length.shape == (6, 2)


@pytest.mark.slow
def test_in_another_order_after_each_other(here: dict[str, Rollout]) -> None:
    names = list(CASES)
    random.Random(3).shuffle(names)
    again = {name: simulate(*case(name)) for name in names}
    assert digests(again) == digests(here)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
async def test_in_any_worker(here: dict[str, Rollout], workers: int) -> None:
    names = sorted(CASES) * workers
    async with RolloutPool(workers) as pool:
        found = await asyncio.gather(*(pool.run(*case(name)) for name in names))
    for name, rollout in zip(names, found, strict=True):
        assert rollout.digest == here[name].digest


SCRIPT = """
from tests.env.test_determinism import CASES, case, simulate
print(*(simulate(*case(name)).digest for name in reversed(CASES)))
"""


@pytest.mark.slow
def test_in_a_new_process_whatever_the_processor_offers(here: dict[str, Rollout]) -> None:
    """NumPy and its linear algebra choose their code by the processor; ours must not depend on
    it."""
    plain = {
        "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX2 FMA3 AVX512F AVX512_SKX",
        "OPENBLAS_CORETYPE": "Nehalem",
        "PYTHONHASHSEED": "7",
    }
    done = run_python("-c", SCRIPT, PYTHONPATH=os.pathsep.join(sys.path), **plain)
    assert done.stdout.split() == [here[name].digest for name in reversed(CASES)]

"""A rollout on MuJoCo next to a loop of its steps that does nothing else.

The loop takes the very steps of a rollout, with the forces and motors that were recorded in it: it
must end in the same state, bit for bit. Beside the engine's two calls it only copies what was
recorded; the time of that is measured alone and subtracted.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import mujoco
import numpy as np
from cars import CAR
from figures import MUJOCO, PYBULLET, Figure, Options, engines, run, shipped, timed

from agentflow.env.physics.mujoco import world
from agentflow.env.physics.mujoco.bodies import set_step_length
from agentflow.machine.tree import Machine

MOST = 1.6
ON_END = 3
ONE_BY_ONE, AGAIN = "mujoco without compiled steps", "mujoco, the same machine again"
STATE = mujoco.mjtState.mjSTATE_INTEGRATION


def machines() -> dict[str, Machine]:
    """Those that are measured."""
    return {
        "car of 20 blocks": CAR,
        "published throw": shipped("published_throw"),
        "throw with springs": shipped("throwing/spring_arm"),
        "machine that breaks": shipped("rotor_with_ballast"),
    }


class Tape:
    """Everything that Python gave the engine in one rollout."""

    def __init__(self) -> None:
        self.steps = 0
        self._stretches: list[tuple[Any, Any, Any, list[tuple[Any, ...]]]] = []
        """Model, state before its first step, its last state, and calls."""
        self._data: Any = None

    def step1(self, model: Any, data: Any) -> None:
        """In place of `mj_step1`."""
        if data is not self._data:
            self._data = data
            self._stretches.append((model, _state(model, data), np.empty(0), []))
        own = self._stretches[-1]
        own[3].append((model.opt.timestep, None, None))
        mujoco.mj_step1(model, data)
        self._stretches[-1] = (model, own[1], _state(model, data), own[3])

    def step2(self, model: Any, data: Any) -> None:
        """In place of `mj_step2`."""
        self.steps += 1
        forces, wanted = data.xfrc_applied.copy(), data.efc_aref.copy()
        self._stretches[-1][3].append((model.opt.timestep, forces, wanted))
        mujoco.mj_step2(model, data)

    def replay(self) -> tuple[float, float]:
        """CPU time of the steps, and of copying alone, s."""
        whole = copying = 0.0
        for model, first, last, calls in self._stretches:
            data = mujoco.MjData(model)
            mujoco.mj_setState(model, data, first, STATE)
            set_step_length(model, calls[0][0])
            whole += _play(model, data, calls, mujoco.mj_step1, mujoco.mj_step2)
            assert np.array_equal(_state(model, data), last)
            copying += _copy(data, calls)
        return whole, copying


def _state(model: Any, data: Any) -> Any:
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    return state


def _play(model: Any, data: Any, calls: list[tuple[Any, ...]], one: Any, two: Any) -> float:
    applied, step = data.xfrc_applied, model.opt.timestep
    began = time.process_time()
    for length, forces, wanted in calls:
        if length != step:
            step = length
            set_step_length(model, step)
        if forces is None:
            one(model, data)
        else:
            applied[:] = forces
            data.efc_aref[:] = wanted
            two(model, data)
    return time.process_time() - began


def _copy(data: Any, calls: list[tuple[Any, ...]]) -> float:
    applied, spare = data.xfrc_applied, np.empty(max(len(c[2]) for c in calls if c[2] is not None))
    began = time.process_time()
    for _, forces, wanted in calls:
        if forces is not None:
            applied[:] = forces
            spare[: len(wanted)] = wanted
    return time.process_time() - began


def record(machine: Machine, engine: Any) -> Tape:
    """Simulate a machine, and keep its steps."""
    tape, real = Tape(), world.mujoco

    class Recorded:
        mj_step1, mj_step2 = staticmethod(tape.step1), staticmethod(tape.step2)

    world.mujoco = Recorded  # type: ignore[assignment]
    try:
        run(machine, engine)
    finally:
        world.mujoco = real
    return tape


def floor(options: Options) -> Iterator[Figure]:
    """Whole rollouts on both engines, with and without compiled steps, and the bare steps of
    MuJoCo's, in turns, each several times on end, as a worker does; machines are kept only where
    the name says so."""
    started: dict[str, Any] = {ONE_BY_ONE: engines()[MUJOCO], **engines()}
    started[ONE_BY_ONE].patience = sys.maxsize
    started[MUJOCO].patience = 0  # compiled steps from the first rollout on
    for name, machine in machines().items():
        tape = record(machine, started[ONE_BY_ONE])
        least = dict.fromkeys((*started, AGAIN, "bare"), float("inf"))
        for _ in range(options.repeats):
            for _ in range(ON_END):
                whole, copying = tape.replay()
                least["bare"] = min(least["bare"], whole - copying)
            for key, engine in (*started.items(), (AGAIN, started[MUJOCO])):
                for _ in range(ON_END):
                    seconds = timed(engine, partial(run, machine, engine), apart=key != AGAIN)
                    least[key] = min(least[key], seconds)
        ms = {key: 1e3 * seconds for key, seconds in least.items()}
        bare, steps = ms["bare"], f"bare steps ({tape.steps})"
        for key in (MUJOCO, AGAIN):
            told = f"{ms[key]:.1f} ms, {ms[key] / bare:.2f} x the {bare:.1f} ms of {steps}"
            yield Figure(f"{name}, {key}", told, f"{MOST} x", ms[key] <= MOST * bare)
        yield Figure(f"{name}, {ONE_BY_ONE}", f"{ms[ONE_BY_ONE]:.1f} ms")
        yield Figure(f"{name}, {PYBULLET}", f"{ms[PYBULLET]:.1f} ms")
    for engine in started.values():
        engine.close()

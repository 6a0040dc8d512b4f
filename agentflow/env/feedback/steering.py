"""How far steering blocks and steering hinges are turned over time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from agentflow.env.feedback.text import Angles, number, sample_indices
from agentflow.env.rollout import Array, Trace
from agentflow.env.rotations import compose, conjugate
from agentflow.machine.blocks.library import STEERING, library
from agentflow.machine.blocks.types import DIRECTIONS
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine

MOST = 4
"""Most series; blocks that turn alike share one."""


def steering_angles(machine: Machine, trace: Trace) -> list[Angles]:
    """The angles of all steering blocks and hinges against their parents, degrees, from 0 as built.

    They are positive in the sense in which level 1 turns a block, and end where it breaks off.
    `trace` is evenly sampled.
    """
    picks = sample_indices(len(trace.times))
    times = trace.times[picks]
    alike: dict[tuple[str, ...], list[int]] = {}
    angles: dict[int, Array] = {}
    for block, turned in _turns(machine, trace):
        angles[block] = turned[picks][trace.alive[picks, block]]
        if len(angles[block]):
            alike.setdefault(tuple(number(each, 0) for each in angles[block]), []).append(block)
    found = [
        Angles(_label(blocks), times[: len(shown)].tolist(), angles[blocks[0]][:, None].tolist())
        for shown, blocks in alike.items()
    ]
    if hidden := sum(map(len, list(alike.values())[MOST:])):
        last = found[MOST - 1]
        found[MOST - 1] = replace(last, label=f"{last.label}, {hidden} more not shown,")
    return found[:MOST]


def _label(blocks: list[int]) -> str:
    return f"Steering of {', '.join(map(str, blocks))} (deg, + at level 1)"


def _turns(machine: Machine, trace: Trace) -> Iterator[tuple[int, Array]]:
    """Each steering block with its (T,) angles, degrees; they may exceed a turn."""
    built = {block.id: np.array(block.quaternion) for block in place(machine).blocks}
    for step in machine:
        if step.type not in STEERING:
            continue
        joint = library()[step.type].joint
        rest = compose(conjugate(built[step.parent]), built[step.id])
        own, parent = trace.rotation[:, step.id], trace.rotation[:, step.parent]
        turn = compose(conjugate(rest), compose(conjugate(parent), own))
        about = turn[:, :3] @ np.array(DIRECTIONS[joint.axis], dtype=float)
        turned = np.unwrap(2.0 * np.arctan2(about, turn[:, 3]), period=2.0 * np.pi)
        yield step.id, np.degrees(joint.motor_sense * turned)

"""How far steering blocks and steering hinges are turned over time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from agentflow.env.feedback.text import Angles, number, sample_indices
from agentflow.env.joints import joint_angle
from agentflow.env.rollout import Array, Trace
from agentflow.machine.blocks.library import STEERING, library
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
    for step in machine:
        if step.type in STEERING:
            sense = library()[step.type].joint.motor_sense
            yield step.id, np.degrees(sense * joint_angle(machine, trace, step.id))

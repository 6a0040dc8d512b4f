"""How far turning joints are turned over time, from recorded states."""

from __future__ import annotations

import numpy as np

from agentflow.env.rollout import Array, Trace
from agentflow.env.rotations import compose, conjugate, rotate
from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import DIRECTIONS
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine


def turns(machine: Machine, block: int) -> bool:
    """Whether a block turns on its parent about one axis."""
    return machine[block].parent >= 0 and library()[machine[block].type].joint.kind == "revolute"


def joint_speed(machine: Machine, trace: Trace, block: int) -> Array:
    """(T,) angular velocity of a block against its parent, rad/s, about its joint's axis."""
    axis = rotate(trace.rotation[:, block], _axis(machine, block))
    relative = trace.angular_velocity[:, block] - trace.angular_velocity[:, machine[block].parent]
    speed: Array = (relative * axis).sum(axis=1)
    return speed


def joint_angle(machine: Machine, trace: Trace, block: int) -> Array:
    """(T,) angle of a block against its parent, rad, about its joint's axis, from 0 as built.

    It counts whole turns: the speeds say how many there were between two samples.
    """
    built = place(machine).blocks
    own, parent = (np.array(built[i].quaternion) for i in (block, machine[block].parent))
    rest = compose(conjugate(parent), own)
    now = compose(conjugate(trace.rotation[:, machine[block].parent]), trace.rotation[:, block])
    turn = compose(conjugate(rest), now)
    about = turn[:, :3] @ _axis(machine, block)
    angle = _within_half_turn(2.0 * np.arctan2(about, turn[:, 3]))
    speed = joint_speed(machine, trace, block)
    expected = (speed[1:] + speed[:-1]) / 2 * np.diff(trace.times)
    steps = expected + _within_half_turn(np.diff(angle) - expected)
    return np.concatenate([angle[:1], angle[0] + np.cumsum(steps)])


def _axis(machine: Machine, block: int) -> Array:
    """The joint's axis in the block's own frame."""
    return np.array(DIRECTIONS[library()[machine[block].type].joint.axis], dtype=float)


def _within_half_turn(angle: Array) -> Array:
    """The same angles between -pi and pi."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)

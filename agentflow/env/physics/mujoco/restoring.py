"""Positions and velocities of a MuJoCo model: at the start, and after it was built again."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from agentflow.env.physics.frames import swap, swap_quaternion
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.mujoco.bodies import Built, Place
from agentflow.env.physics.mujoco.shapes import wxyz
from agentflow.env.physics.readings import joint_motion, relative_motion
from agentflow.env.physics.rows import POSITION, ROTATION, SPIN, VELOCITY
from agentflow.env.rollout import Array
from agentflow.env.rotations import matrices, turn_back
from agentflow.env.scene import Start
from agentflow.machine.geometry.vectors import add, rotate_vector


def place_at_start(built: Built, assembly: Assembly, start: Start) -> None:
    """Move the machine from the ground to the start of the scene."""
    for part, place in built.roots.items():
        centre = add(
            rotate_vector(start.rotation, assembly.parts[part].centre), (0, start.height, 0)
        )
        built.data.qpos[place.position : place.position + 7] = (
            *swap(centre),
            *wxyz(swap_quaternion(start.rotation)),
        )


def restore(
    built: Built,
    assembly: Assembly,
    parts: Array,
    things: Mapping[str, Array],
    motions: Mapping[int, tuple[float, float]],
) -> None:
    """Give a new model the positions and velocities of the one before.

    Args:
        built: The new model.
        assembly: The machine.
        parts: (P, 13) rows of the parts.
        things: (13,) row of each moving thing.
        motions: Position and velocity of joints that were in trees or parallel to those.
    """
    position, velocity = built.data.qpos, built.data.qvel
    for part, place in built.roots.items():
        _set_free(built, place, parts[part])
    for name, place in built.loose.items():
        _set_free(built, place, things[name])
    for link in built.links:
        if link.joint not in built.joints:
            continue
        place = built.joints[link.joint]
        joint = assembly.joints[link.joint]
        at, speed = place.position, place.velocity
        if joint.kind == "spherical":
            rotation, spin = relative_motion(parts[link.parent], parts[link.part])
            position[at : at + 4], velocity[speed : speed + 3] = wxyz(rotation), spin
        else:
            known = motions.get(link.joint)
            position[at], velocity[speed] = known or joint_motion(joint, assembly.parts, parts)


def _set_free(built: Built, place: Place, row: Array) -> None:
    """Set a free joint; MuJoCo has its angular velocity in the body's own axes."""
    spin = turn_back(matrices(row[None, ROTATION]), row[None, SPIN])[0]
    at, speed = place.position, place.velocity
    built.data.qpos[at : at + 7] = [*row[POSITION], *wxyz(row[ROTATION].tolist())]
    built.data.qvel[speed : speed + 6] = np.concatenate([row[VELOCITY], spin])

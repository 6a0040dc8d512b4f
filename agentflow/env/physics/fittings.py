"""Owns which blocks act on a machine beside their joints: reads them off the placed blocks.

What they do each step is flight.py's, ropes.py's, grip.py's and couplings.py's.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians, sin

from agentflow.env.constants import Constants
from agentflow.env.physics.actors import Actors, Grip, Lift, Mesh, Rope, Thrust
from agentflow.env.physics.model import Joint
from agentflow.env.physics.vectors import add, length, scale, subtract
from agentflow.machine.blocks.library import GRABBER, library
from agentflow.machine.blocks.types import BlockType
from agentflow.machine.geometry.gears import meshing_pairs
from agentflow.machine.geometry.placement import Placed

WINCH = 45


def fit(
    placed: Sequence[Placed],
    parts: Sequence[tuple[int, ...]],
    joints: Sequence[Joint],
    constants: Constants,
) -> Actors:
    """What acts in a machine.

    Args:
        placed: All blocks, by id.
        parts: Part indices of each block.
        joints: All joints, as the assembly numbers them.
        constants: Of winches, grabbers and cogs; thrust and blades are the library's.
    """
    known = [(block, library()[block.type], parts[block.id]) for block in placed]
    return Actors(
        thrusts=tuple(
            Thrust(block.id, own[0], scale(block.front, kind.thrust))
            for block, kind, own in known
            if kind.thrust is not None
        ),
        lifts=tuple(
            _lift(block, kind, own[0]) for block, kind, own in known if kind.blade is not None
        ),
        ropes=tuple(
            _rope(block, own, constants) for block, kind, own in known if kind.type == WINCH
        ),
        grips=tuple(
            _grip(block, own[0], joints, constants)
            for block, kind, own in known
            if kind.type == GRABBER
        ),
        meshes=meshes(placed, joints, constants["cog_tolerance"]),
    )


def meshes(placed: Sequence[Placed], joints: Sequence[Joint], tolerance: float) -> tuple[Mesh, ...]:
    """What gears.py finds to mesh, as joints."""
    turning = {joint.block: i for i, joint in enumerate(joints) if joint.kind == "revolute"}
    return tuple(
        Mesh(turning[pair.a], turning[pair.b], pair.ratio)
        for pair in meshing_pairs(placed, tolerance)
    )


def _rope(block: Placed, own: tuple[int, ...], constants: Constants) -> Rope:
    return Rope(
        block=block.id,
        a=own[0],
        b=own[1],
        speed=constants["winch_speed"],
        shortest=constants["winch_shortest"],
        stiffness=constants["winch_stiffness"],
        damping=constants["winch_damping"],
        force=constants["winch_force"],
    )


def _grip(block: Placed, part: int, joints: Sequence[Joint], constants: Constants) -> Grip:
    """A grabber; what it is joined to it does not take hold of."""
    own = [joint for joint in joints if part in (joint.a, joint.b)]
    return Grip(
        block=block.id,
        part=part,
        front=block.front,
        reach=length(subtract(block.center, block.origin)),
        force=constants.of("strength_force", GRABBER),
        joined=frozenset(end for joint in own for end in (joint.a, joint.b)),
    )


def _lift(block: Placed, kind: BlockType, part: int) -> Lift:
    """Blade law of `data/reference_physics.json`: the normal is Up turned about Front."""
    blade = kind.blade
    assert blade is not None
    angle = radians(blade.lift_angle_deg)
    return Lift(
        block=block.id,
        part=part,
        push=block.up,
        normal=add(scale(block.up, cos(angle)), scale(block.right, -sin(angle))),
        drag=blade.axial_drag,
        speed_cap=blade.speed_cap,
    )

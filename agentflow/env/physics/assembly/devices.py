"""Devices of a machine: thrusters, propeller blades, springs, winches, grabbers, meshing cogs."""

from collections.abc import Sequence
from dataclasses import replace

from agentflow.env.constants import Constants
from agentflow.env.physics.laws.flight import Heat, PropellerBlade, Thruster
from agentflow.env.physics.laws.motion import MotionDevice
from agentflow.env.physics.laws.tension import Spring, Winch
from agentflow.env.physics.model import CogMesh, Devices, Gripper, Joint, Part
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.gears import meshing_pairs
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.vectors import length, scale, subtract

MOVED: tuple[type[MotionDevice], ...] = (PropellerBlade,)
"""The kinds of devices that push their part as it moves."""


def devices_of(
    blocks: Sequence[Placed],
    parts: Sequence[tuple[int, ...]],
    joints: Sequence[Joint],
    constants: Constants,
) -> Devices:
    """The devices of a machine; `parts` are the part indices of each of its blocks."""
    known = [(block, library()[block.type], parts[block.id]) for block in blocks]
    return Devices(
        springs=tuple(
            _spring(block, own, constants)
            for block, kind, own in known
            if kind.connector == "spring"
        ),
        thrusters=tuple(
            Thruster(own[0], scale(block.direction(kind.push), kind.thrust), kind.steam)
            for block, kind, own in known
            if kind.thrust is not None
        ),
        flames=tuple(
            Heat(own[0], scale(block.direction(flame.direction), flame.reach), flame.radius)
            for block, kind, own in known
            if (flame := kind.flame) is not None
        ),
        moved=tuple(
            device
            for block, kind, own in known
            for each in MOVED
            if (device := each.of(block, kind, own[0])) is not None
        ),
        winches=tuple(_winch(own, constants) for _, kind, own in known if kind.connector == "rope"),
        grippers=tuple(
            _gripper(block, kind.grip_direction, own[0], joints, constants)
            for block, kind, own in known
            if kind.grip_direction is not None
        ),
        cog_meshes=cog_meshes(blocks, joints, constants["cog_tolerance"]),
    )


def control_devices(devices: Devices, parts: Sequence[Part]) -> Devices:
    """The devices of a machine with controls: each follows the level of its own block."""
    return replace(
        devices,
        springs=tuple(replace(each, starts=parts[each.a].block) for each in devices.springs),
        thrusters=tuple(replace(each, starts=parts[each.part].block) for each in devices.thrusters),
        winches=tuple(replace(each, starts=parts[each.a].block) for each in devices.winches),
        grippers=tuple(replace(each, starts=parts[each.part].block) for each in devices.grippers),
    )


def cog_meshes(
    blocks: Sequence[Placed], joints: Sequence[Joint], tolerance: float
) -> tuple[CogMesh, ...]:
    """Pairs of joints whose blocks are cogs with pitch circles that touch within `tolerance`, m."""
    turning = {joint.block: i for i, joint in enumerate(joints) if joint.kind == "revolute"}
    return tuple(
        CogMesh(turning[pair.a], turning[pair.b], pair.ratio)
        for pair in meshing_pairs(blocks, tolerance)
    )


def _spring(block: Placed, parts: tuple[int, ...], constants: Constants) -> Spring:
    return Spring(
        a=parts[0],
        b=parts[1],
        natural=constants["spring_length"],
        ramp=constants["spring_ramp"],
        force=constants.of("spring_force", block.type),
        damping=constants["spring_damping"],
    )


def _winch(parts: tuple[int, ...], constants: Constants) -> Winch:
    return Winch(
        a=parts[0],
        b=parts[1],
        speed=constants["winch_speed"],
        shortest=constants["winch_shortest"],
        stiffness=constants["winch_stiffness"],
        damping=constants["winch_damping"],
        force=constants["winch_force"],
    )


def _gripper(
    block: Placed, direction: str, part: int, joints: Sequence[Joint], constants: Constants
) -> Gripper:
    """A grabber; it never grips what it is joined to."""
    own = [joint for joint in joints if part in (joint.a, joint.b)]
    return Gripper(
        part=part,
        front=block.direction(direction),
        reach=length(subtract(block.center, block.origin)),
        force=constants.of("strength_force", block.type),
        joined=frozenset(end for joint in own for end in (joint.a, joint.b)),
    )

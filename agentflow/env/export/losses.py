"""What a URDF file cannot hold of a machine, in words."""

from __future__ import annotations

from collections.abc import Iterable

from agentflow.env.physics.model import Assembly
from agentflow.env.physics.structure.spanning_tree import Skeleton


def urdf_losses(assembly: Assembly, plan: Skeleton) -> tuple[str, ...]:
    """What the file does not hold, or holds in another way, one sentence each."""
    parts, joints, devices = assembly.parts, assembly.joints, assembly.devices
    moving = [joints[link.joint] for link in plan.links if not link.rigid]
    lost = {
        "the pull of springs": [parts[spring.a].block for spring in devices.springs],
        "the pull of winches": [parts[winch.a].block for winch in devices.winches],
        "thrust": [parts[thruster.part].block for thruster in devices.thrusters],
        **motion_losses(assembly),
        "the grip of grabbers": [parts[gripper.part].block for gripper in devices.grippers],
        "the springs of suspensions": [joint.block for joint in moving if joint.drive.stiffness],
        "joints that close loops, which are open": [joints[i.joint].block for i in plan.loops],
    }
    notes = [
        "URDF does not hold air drag, friction between surfaces, or the strength of connections"
    ]
    notes += [f"URDF does not hold {what}: {name_blocks(ids)}" for what, ids in lost.items() if ids]
    if any(joint.drive.torque for joint in moving):
        notes.append("motors are limits of effort and velocity; comments say which way they turn")
    if balls := [joint.block for joint in moving if joint.kind == "spherical"]:
        notes.append(f"ball joints are hinges about x, y and z in series: {name_blocks(balls)}")
    return tuple(notes)


def motion_losses(assembly: Assembly) -> dict[str, list[int]]:
    """What is lost with devices that push their part as it moves -> their blocks."""
    lost: dict[str, list[int]] = {}
    for device in assembly.devices.moved:
        lost.setdefault(device.loss, []).append(assembly.parts[device.part].block)
    return lost


def name_blocks(ids: Iterable[int]) -> str:
    """Such as "blocks 2, 5"."""
    listed = sorted(set(ids))
    return f"block{'s' if len(listed) > 1 else ''} {', '.join(map(str, listed))}"

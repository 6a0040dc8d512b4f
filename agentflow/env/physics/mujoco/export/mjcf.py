"""A machine in the scene of a task as MJCF, the file format of MuJoCo: the model of the engine.

The model is at rest as it was assembled. Its keyframe `start` is the settled machine, switched on
as the task does at t = 0.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from agentflow.env.constants import Constants, constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.frames import swap
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.mujoco import MUJOCO
from agentflow.env.physics.mujoco.bodies import CompiledModel
from agentflow.env.physics.mujoco.engine import MuJoCoEngine
from agentflow.env.physics.mujoco.export.actuators import Actuators
from agentflow.env.physics.structure.spanning_tree import skeleton
from agentflow.env.scene import Scene
from agentflow.env.tasks.base import Switch, Task
from agentflow.env.urdf import joint_names, link_names, motion_losses, name_blocks
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import subtract
from agentflow.machine.tree import Machine

RATE = 500.0
"""Hz: fine steps of a length that is exact in the six digits of the file."""
TILT = (1.0, 2e-5, 0.0, 0.0)
"""As `shapes.TILT`, w first: 4e-5 rad, which six digits keep."""
ROD_RADIUS = 0.09
"""Of braces, which nothing touches, m."""
ABOUT = """
A machine and the scene of the task {task}, as the physics engine {engine} builds them.
Metres, kilograms, seconds; z is up, and the machine faces y+.
Controls are levels of the task's schedule: 1 is full speed, 0 holds, -1 runs backwards.
With all controls at 0 the machine settles. The keyframe "start" is the settled machine at t = 0 of
a simulation, with what the task switches on then.
Bodies and joints are named after their blocks, as in a .urdf file.
{notes}
"""


def machine_mjcf(machine: Machine, task: Task) -> tuple[bytes, tuple[str, ...]]:
    """The file of a machine that is valid on a task, and what it cannot hold."""
    value = constants()
    assembly, scene = assemble(machine, place(machine), value), task.scene(machine)
    built = MuJoCoEngine().build(assembly, scene, RATE).now.built
    spec = built.spec
    _place(built)
    _colour(built, assembly, scene)
    actuators = Actuators(built, assembly)
    actuators.add()
    settled, moving = _settle(spec.compile(), value)
    levels = {entry: level for time, entry, level in task.switches(machine) if time <= 0.0}
    controls = [levels.get(entry, 0.0) for entry in actuators.entries]
    spec.add_key(name="start", qpos=settled, ctrl=controls)
    notes = _losses(machine, assembly, scene, task, any(built.lively))
    notes += _later_switches(task.switches(machine))
    notes += ("the machine still moves after settling",) if moving else ()
    spec.modelname, spec.comment = "machine", _describe(task, notes)
    spec.compile()
    return _rename(spec.to_xml(), machine, assembly).encode(), notes


def _rename(xml: str, machine: Machine, assembly: Assembly) -> str:
    """The file with bodies and joints named after their blocks."""
    links = link_names(machine, assembly)
    joints = joint_names(links, skeleton(len(assembly.parts), assembly.joints))
    xml = re.sub(r'"part (\d+)"', lambda found: f'"{links[int(found[1])]}"', xml)
    return re.sub(
        r'(<joint name|\bjoint[12]?)="(\d+)"',
        lambda found: f'{found[1]}="{joints[int(found[2])]}"',
        xml,
    )


def _describe(task: Task, notes: Sequence[str]) -> str:
    """The comment at the beginning of the file, in which XML forbids two hyphens in a row."""
    text = ABOUT.format(
        task=task.name,
        engine=MUJOCO.identity,
        notes="\n".join(f"* {note}" for note in notes),
    )
    return text.replace("--", "- -")


def _place(built: CompiledModel) -> None:
    """Move the machine to the start of the scene, and tilt cylinders so that the file keeps it."""
    for part, at in built.roots.items():
        body = built.spec.body(built.model.body(built.parts[part]).name)
        pose = built.data.qpos[at.position : at.position + 7]
        body.pos, body.quat = pose[:3], pose[3:]
    for geom in built.spec.geoms:
        if geom.type == mujoco.mjtGeom.mjGEOM_CYLINDER:
            turned = np.zeros(4)
            mujoco.mju_mulQuat(turned, geom.quat, np.array(TILT))
            geom.quat = turned


def _colour(built: CompiledModel, assembly: Assembly, scene: Scene) -> None:
    """Light the scene, colour all shapes, and draw braces, which are shapes that touch nothing."""
    spec = built.spec
    colours: dict[Any, Sequence[float]] = {item.name: item.color for item in scene.objects}
    colours |= {part.block: part.color for part in assembly.parts}
    for number, owner in enumerate(built.owners):
        geom = spec.geom(built.model.geom(number).name)
        geom.rgba = colours.get(owner, geom.rgba)
    devices = assembly.devices
    stretching = {spring.a for spring in devices.springs} | {winch.a for winch in devices.winches}
    for block, first, second in assembly.spans:
        if first not in stretching:
            body = spec.body(built.model.body(built.parts[first]).name)
            ends = assembly.parts[first].centre, assembly.parts[second].centre
            rod = body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, mass=0.0, rgba=colours[block])
            rod.size[0], rod.contype, rod.conaffinity = ROD_RADIUS, 0, 0
            rod.fromto = [*body.ipos, *(body.ipos + swap(subtract(ends[1], ends[0])))]
    spec.worldbody.add_light(
        pos=[0.0, 0.0, 30.0], dir=[0.2, 0.3, -1.0], type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    )


def _settle(model: Any, value: Constants) -> tuple[Any, bool]:
    """Positions after the model has settled with all controls at 0, and whether it still moves."""
    data, still = mujoco.MjData(model), 0.0
    while still < value["settle_least"] and data.time < value["settle_most"]:
        mujoco.mj_step(model, data)
        slow = np.abs(data.qvel).max() < value["rest_speed"]
        still = still + model.opt.timestep if slow else 0.0
    return data.qpos, still < value["settle_least"]


def _losses(
    machine: Machine, assembly: Assembly, scene: Scene, task: Task, lively: bool
) -> tuple[str, ...]:
    """What the file does not hold, one sentence each."""
    parts, devices = assembly.parts, assembly.devices
    releasing = [step.id for step in machine if library()[step.type].group == "decouplers"]
    lost = {
        "the pull of winches": [parts[winch.a].block for winch in devices.winches],
        **motion_losses(assembly),
        "the grip of grabbers": [parts[gripper.part].block for gripper in devices.grippers],
        "the release of decouplers": releasing,
    }
    notes = ["MJCF does not hold the strength of connections: nothing breaks"]
    notes += [f"MJCF does not hold {what}: {name_blocks(ids)}" for what, ids in lost.items() if ids]
    if lively:
        notes.append("MJCF does not hold how slow contacts of elastic surfaces are damped")
    if any(scene.wind):
        notes.append("MJCF does not hold the wind of the task")
    for what, names in {
        "how the load grows": [item.name for item in scene.objects if item.load],
        "how softly this gives way": [t.name for t in scene.objects if t.stiffness is not None],
    }.items():
        notes += [f"MJCF does not hold {what}: {', '.join(names)}"] if names else []
    if task.trials(0) != (task,):
        notes.append("the task is tried with variations; the file holds its scene without them")
    return tuple(notes)


def _later_switches(switches: Sequence[Switch]) -> tuple[str, ...]:
    """What is switched after t = 0, which the file does not hold, in one sentence."""
    later = [
        f"{f'block {entry}' if isinstance(entry, int) else entry} to {level:g} at {time:g} s"
        for time, entry, level in switches
        if time > 0.0 and entry != "loads"
    ]
    return (f"MJCF does not hold the later switches of the task: {', '.join(later)}",) * bool(later)

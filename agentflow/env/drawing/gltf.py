"""Machines and animated rollouts as .glb files; blocks are nodes named by id and type."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agentflow.env.drawing.film import TRAIL, tracked_block
from agentflow.env.drawing.glb import Glb, Rgba
from agentflow.env.drawing.solids import BROKEN, MachineSolids, Pose
from agentflow.env.rollout import Array, Rollout, Trace
from agentflow.env.scene import Scene, SceneObject
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine, Step

ORIGIN = (0.0, 0.0, 0.0)
VISIBLE, HIDDEN = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
"""Scales that show and hide a node."""
TRAIL_COLOR: Rgba = (TRAIL[0] / 255, TRAIL[1] / 255, TRAIL[2] / 255, 1.0)
INSTANT = 1e-3
"""Earliest time of a change, s: the times of an animation must differ."""


def machine_glb(machine: Machine) -> bytes:
    """A file-valid machine as built, standing on y = 0."""
    glb, shapes = Glb(), MachineSolids(machine)
    blocks = [_block(glb, step, shapes, shapes.rest) for step in machine]
    return glb.to_bytes([glb.node("machine", blocks)])


def rollout_glb(machine: Machine, rollout: Rollout) -> bytes:
    """A rollout with its scene and the path of the boulder or root; broken blocks turn red.

    Args:
        machine: The simulated machine.
        rollout: A rollout with a trace.
    """
    trace, scene = rollout.trace, rollout.scene
    assert trace is not None
    assert scene is not None
    glb, shapes = Glb(), MachineSolids(machine)
    breaks = {item.block: item.time for item in reversed(rollout.broken)}
    poses = [Pose.at(trace, index) for index in range(len(trace.times))]
    blocks = []
    for step in machine:
        blocks.append(_block(glb, step, shapes, poses[0], breaks.get(step.id)))
        _animate_block(glb, blocks[-1], step, shapes, trace, poses)
    path = glb.line("path", trace.centre[:, tracked_block(machine)], TRAIL_COLOR)
    return glb.to_bytes([glb.node("machine", blocks), _scene(glb, scene, trace), path])


def _block(
    glb: Glb, step: Step, shapes: MachineSolids, pose: Pose, breaks: float | None = None
) -> int:
    """Add the node of one block, with its solids and, if it breaks, a red copy of them."""
    solids: Sequence[SceneObject] = shapes.solids[step.id]
    place: dict[str, object] = {
        "translation": pose.centre[step.id],
        "rotation": pose.rotation[step.id],
    }
    if step.two_ended:
        rod = shapes.rod(step.id, pose)
        place = {"translation": rod.position, "rotation": rod.rotation, "scale": rod.size}
        solids = [SceneObject(rod.name, rod.shape, VISIBLE, ORIGIN, color=rod.color)]
    children = [glb.solid(solid) for solid in solids]
    if breaks is not None:
        red = [glb.solid(solid, BROKEN) for solid in solids]
        children = [
            _toggled_node(glb, children, breaks, on=False),
            _toggled_node(glb, red, breaks, on=True),
        ]
    name = f"block {step.id} {library()[step.type].name}"
    return glb.node(name, children, extras={"block": step.id, "type": step.type}, **place)


def _toggled_node(glb: Glb, solids: Sequence[int], time: float, *, on: bool) -> int:
    """Add a node whose solids appear or disappear at one moment."""
    sizes = np.array([HIDDEN, VISIBLE] if on else [VISIBLE, HIDDEN])
    node = glb.node("broken" if on else "whole", solids, scale=sizes[0])
    glb.animate(node, "scale", np.array([0.0, max(time, INSTANT)]), sizes, step=True)
    return node


def _animate_block(
    glb: Glb, node: int, step: Step, shapes: MachineSolids, trace: Trace, poses: Sequence[Pose]
) -> None:
    """Animate a block's node along the trace; two-ended blocks disappear when they disconnect."""
    if not step.two_ended:
        glb.animate(node, "translation", trace.times, trace.centre[:, step.id])
        glb.animate(node, "rotation", trace.times, _unify_signs(trace.rotation[:, step.id]))
        return
    rods = [shapes.rod(step.id, pose) for pose in poses]
    turns = _unify_signs(np.array([rod.rotation for rod in rods]))
    connected = trace.alive[:, [step.id]]
    sizes = np.where(connected, np.array([rod.size for rod in rods]), HIDDEN)
    glb.animate(node, "translation", trace.times, np.array([rod.position for rod in rods]))
    glb.animate(node, "rotation", trace.times, turns)
    glb.animate(node, "scale", trace.times, sizes)


def _scene(glb: Glb, scene: Scene, trace: Trace) -> int:
    """Add the scene's objects, animated if they move."""
    nodes = []
    for item in scene.objects:
        nodes.append(glb.solid(item))
        if item.name in trace.objects:
            column = trace.objects.index(item.name)
            turns = _unify_signs(trace.object_rotation[:, column])
            glb.animate(nodes[-1], "translation", trace.times, trace.object_position[:, column])
            glb.animate(nodes[-1], "rotation", trace.times, turns)
    return glb.node("scene", nodes)


def _unify_signs(rotation: Array) -> Array:
    """Flip the signs of (T, 4) quaternions so that neighbours interpolate the short way."""
    sides = np.sign(np.sum(rotation[1:] * rotation[:-1], axis=1))
    flips = np.cumprod(np.concatenate([[1.0], np.where(sides < 0, -1.0, 1.0)]))
    steady: Array = rotation * flips[:, None]
    return steady

"""Owns three-dimensional files (.glb): a machine as built, and its rollout as an animation.

Blocks are nodes named by id and type, in build order. The container is glb.py's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agentflow.env.drawing.figures import BROKEN, Figures, Pose
from agentflow.env.drawing.film import TRAIL, hero_of
from agentflow.env.drawing.glb import Glb, Rgba
from agentflow.env.rollout import Array, Rollout, Trace
from agentflow.env.scene import Scene, Thing
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine, Step

ORIGIN = (0.0, 0.0, 0.0)
HERE, GONE = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
"""Sizes of what is shown and of what is not."""
TRAIL_COLOR: Rgba = (TRAIL[0] / 255, TRAIL[1] / 255, TRAIL[2] / 255, 1.0)
INSTANT = 1e-3
"""Least time before a change, s: keys of an animation must differ."""


def machine_glb(machine: Machine) -> bytes:
    """A machine as built, standing on y = 0.

    Args:
        machine: File-valid.
    """
    glb, figures = Glb(), Figures(machine)
    blocks = [_block(glb, step, figures, figures.rest) for step in machine]
    return glb.to_bytes([glb.node("machine", blocks)])


def rollout_glb(machine: Machine, rollout: Rollout) -> bytes:
    """A rollout with the scene and the path of the boulder or the root; broken blocks turn red.

    Args:
        machine: What was simulated.
        rollout: With a trace.
    """
    trace, scene = rollout.trace, rollout.scene
    assert trace is not None
    assert scene is not None
    glb, figures = Glb(), Figures(machine)
    breaks = {item.block: item.time for item in reversed(rollout.broken)}
    poses = [
        Pose(centre, rotation, alive=set(np.flatnonzero(alive).tolist()))
        for centre, rotation, alive in zip(trace.centre, trace.rotation, trace.alive, strict=True)
    ]
    blocks = []
    for step in machine:
        blocks.append(_block(glb, step, figures, poses[0], breaks.get(step.id)))
        _follow(glb, blocks[-1], step, figures, trace, poses)
    path = glb.line("path", trace.centre[:, hero_of(machine)], TRAIL_COLOR)
    return glb.to_bytes([glb.node("machine", blocks), _scene(glb, scene, trace), path])


def _block(glb: Glb, step: Step, figures: Figures, pose: Pose, breaks: float | None = None) -> int:
    """The node of one block, whose children are its solids; a copy in red if it breaks."""
    solids: Sequence[Thing] = figures.solids[step.id]
    place: dict[str, object] = {
        "translation": pose.centre[step.id],
        "rotation": pose.rotation[step.id],
    }
    if step.two_ended:
        rod = figures.rod(step.id, pose)
        place = {"translation": rod.position, "rotation": rod.rotation, "scale": rod.size}
        solids = [Thing(rod.name, rod.shape, HERE, ORIGIN, color=rod.color)]
    children = [glb.solid(solid) for solid in solids]
    if breaks is not None:
        red = [glb.solid(solid, BROKEN) for solid in solids]
        children = [
            _switched(glb, children, breaks, on=False),
            _switched(glb, red, breaks, on=True),
        ]
    name = f"block {step.id} {library()[step.type].name}"
    return glb.node(name, children, extras={"block": step.id, "type": step.type}, **place)


def _switched(glb: Glb, solids: Sequence[int], time: float, *, on: bool) -> int:
    """Solids that appear or vanish at one moment."""
    sizes = np.array([GONE, HERE] if on else [HERE, GONE])
    node = glb.node("broken" if on else "whole", solids, scale=sizes[0])
    glb.animate(node, "scale", np.array([0.0, max(time, INSTANT)]), sizes, step=True)
    return node


def _follow(
    glb: Glb, node: int, step: Step, figures: Figures, trace: Trace, poses: Sequence[Pose]
) -> None:
    """Let a block's node go where the block went; a spring vanishes when it lets go."""
    if not step.two_ended:
        glb.animate(node, "translation", trace.times, trace.centre[:, step.id])
        glb.animate(node, "rotation", trace.times, _steady(trace.rotation[:, step.id]))
        return
    rods = [figures.rod(step.id, pose) for pose in poses]
    sizes = [
        rod.size if step.id in pose.alive else GONE for rod, pose in zip(rods, poses, strict=True)
    ]
    glb.animate(node, "translation", trace.times, np.array([rod.position for rod in rods]))
    glb.animate(node, "rotation", trace.times, _steady(np.array([rod.rotation for rod in rods])))
    glb.animate(node, "scale", trace.times, np.array(sizes))


def _scene(glb: Glb, scene: Scene, trace: Trace) -> int:
    """What stands and moves around the machine."""
    nodes = []
    for thing in scene.things:
        nodes.append(glb.solid(thing))
        if thing.name in trace.things:
            column = trace.things.index(thing.name)
            turns = _steady(trace.thing_rotation[:, column])
            glb.animate(nodes[-1], "translation", trace.times, trace.thing_position[:, column])
            glb.animate(nodes[-1], "rotation", trace.times, turns)
    return glb.node("scene", nodes)


def _steady(rotation: Array) -> Array:
    """The same orientations, (T, 4), with each quaternion on the side of the one before."""
    sides = np.sign(np.sum(rotation[1:] * rotation[:-1], axis=1))
    flips = np.cumprod(np.concatenate([[1.0], np.where(sides < 0, -1.0, 1.0)]))
    steady: Array = rotation * flips[:, None]
    return steady

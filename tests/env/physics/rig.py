"""A test stand: a machine whose root weighs so much that nothing moves it, high up in the air."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import atan2

import numpy as np

from agentflow.env.constants import Constants, constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import Engine, World
from agentflow.env.physics.model import Assembly
from agentflow.env.rollout import Array
from agentflow.env.rotations import compose, conjugate, rotate
from agentflow.env.scene import Scene
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.vectors import Vec3, add
from agentflow.machine.tree import Machine

RATE = 120.0
HEIGHT = 50.0
ANCHOR = 1e6
"""kg."""
FACINGS = ("z+", "z-", "x-", "x+", "y+", "y-")
"""Of the root's faces, in order."""


def run(world: World, seconds: float) -> None:
    """Make its steps."""
    for _ in range(round(seconds * RATE)):
        world.step()


def weightless() -> Constants:
    """The constants of a world without gravity."""
    return constants().changed({"gravity": 0.0})


def raised(assembly: Assembly, mass: float | None = ANCHOR) -> Assembly:
    """The assembly `HEIGHT` above the ground, its root as heavy as an anchor."""
    up = (0.0, HEIGHT, 0.0)
    parts = [replace(part, centre=add(part.centre, up)) for part in assembly.parts]
    if mass is not None:
        parts[0] = replace(parts[0], mass=mass, inertia=(mass, mass, mass))
    return replace(
        assembly,
        parts=tuple(parts),
        joints=tuple(replace(joint, pivot=add(joint.pivot, up)) for joint in assembly.joints),
        origins=tuple(add(origin, up) for origin in assembly.origins),
        centres=tuple(add(centre, up) for centre in assembly.centres),
    )


class Rig:
    """One machine on one engine, its blocks and how they have turned."""

    def __init__(
        self,
        engine: Engine,
        tree: Machine,
        *,
        wind: Sequence[float] = (0.0, 0.0, 0.0),
        anchored: bool = True,
        assembly: Assembly | None = None,
    ) -> None:
        """Mount the machine, or this assembly of it."""
        geometry = place(tree)
        assert not geometry.overlaps
        self.blocks: tuple[Placed, ...] = geometry.blocks
        self.assembly = raised(
            assembly or assemble(tree, geometry, constants()), ANCHOR if anchored else None
        )
        x, y, z = (float(speed) for speed in wind)
        self.world = engine.build(self.assembly, Scene(wind=(x, y, z)), RATE)
        self.rest = self.world.state()

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * RATE)):
            self.world.step()

    def turned(self, block: int, vector: Vec3, base: int = 0) -> Array:
        """Where a direction of a block at rest points now, as its base block sees it."""
        state = self.world.state()
        now = compose(state.rotation[block], conjugate(self.rest.rotation[block]))
        carrier = compose(state.rotation[base], conjugate(self.rest.rotation[base]))
        return rotate(conjugate(carrier), rotate(now, np.array(vector)))

    def angle(self, block: int, axis: Vec3, base: int = 0) -> float:
        """How far a block has turned about an axis, rad; asserts that it did about no other."""
        state = self.world.state()
        now = compose(state.rotation[block], conjugate(self.rest.rotation[block]))
        carrier = compose(state.rotation[base], conjugate(self.rest.rotation[base]))
        x, y, z, w = compose(conjugate(carrier), now)
        along = float(np.dot((x, y, z), axis))
        assert np.linalg.norm(np.array((x, y, z)) - along * np.array(axis)) < 5e-3
        return float(2 * atan2(along, w) if w >= 0 else 2 * atan2(-along, -w))

    def spin(self, block: int, axis: Vec3) -> float:
        """rad/s about an axis fixed in the world."""
        return float(np.dot(self.world.state().angular_velocity[block], axis))

    def moved(self, block: int) -> Array:
        """Of the block's centre against the root since both were mounted, m."""
        gone = self.world.state().centre - self.rest.centre
        return np.asarray(gone[block] - gone[0])


def face_towards(tree: Machine, block: int, facing: str) -> int:
    """The first face of a block that faces there."""
    return next(f.face_id for f in place(tree).blocks[block].faces if f.facing == facing)

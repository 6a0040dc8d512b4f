"""The shapes of a MuJoCo model, which have no mass of their own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from agentflow.env.physics.frames import swap, swap_all, swap_quaternion
from agentflow.env.physics.mujoco.surfaces import Surface, Surfaces
from agentflow.env.physics.solids import cone_corners
from agentflow.env.scene import Body
from agentflow.machine.geometry.vectors import Quat, Vec3, product, scale

TILT: Quat = (5e-7, 0.0, 0.0, 1.0)
"""Turns every cylinder by 1e-6 rad: MuJoCo 3.17 to 4.0.1 finds contacts radii deep if a cylinder's
axis is 1e-15 to 1e-12 rad off the normal of a plane."""


class ShapeWriter:
    """Adds shapes to a specification; the name of each is its number."""

    def __init__(self, spec: Any, surfaces: Surfaces) -> None:
        self._spec, self._surfaces = spec, surfaces
        self.shapes: list[tuple[Any, Body]] = []
        """Each shape, and the block or object that it belongs to."""

    def add_ground(self, surface: Surface, cluster: int) -> None:
        """The plane y = 0."""
        plane = self._add(self._spec.worldbody, "ground", surface, cluster)
        plane.type, plane.size = mujoco.mjtGeom.mjGEOM_PLANE, [0.0, 0.0, 1.0]

    def add(
        self,
        body: Any,
        owner: Body,
        kind: str,
        size: Vec3,
        at: Vec3,
        rotation: Quat,
        surface: Surface,
        cluster: int,
    ) -> Any:
        """A shape of a body.

        Args:
            body: MuJoCo's.
            owner: Block or object.
            kind: As in `scene.SceneObject`.
            size: As there.
            at: Its centre in the body's frame, game frame.
            rotation: In that frame.
            surface: What it is like to touch.
            cluster: It collides with no other shape of this cluster.
        """
        geom = self._add(body, owner, surface, cluster)
        geom.pos = swap(at)
        turn, half = swap_quaternion(rotation), scale(swap(size), 0.5)
        if kind == "sphere":
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, [half[0], 0.0, 0.0]
        elif kind == "cylinder":
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_CYLINDER, [half[0], half[2], 0.0]
            turn = product(turn, TILT)
        elif kind == "cone":
            mesh = self._spec.add_mesh(name=geom.name)
            mesh.uservert = swap_all(np.array(cone_corners(size))).ravel()
            geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, geom.name
        else:
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_BOX, list(half)
        geom.quat = wxyz(turn)
        return geom

    def _add(self, body: Any, owner: Body, surface: Surface, cluster: int) -> Any:
        geom = body.add_geom()
        geom.name = str(len(self.shapes))
        self.shapes.append((geom, owner))
        self._surfaces.cover(geom, surface, cluster)
        return geom


def wxyz(quaternion: Sequence[float]) -> list[float]:
    """MuJoCo's order of a quaternion (x, y, z, w)."""
    x, y, z, w = quaternion
    return [w, x, y, z]

"""Machines as STL and 3MF, the files of 3D printers, in millimetres.

Parts are watertight bodies, and pegs hold them together; manifold3d does the geometry, in
millimetres of the made machine and the frame of `parts`.
"""

from collections.abc import Iterator, Mapping, Sequence
from math import sqrt
from typing import Any

import numpy as np
from manifold3d import Manifold, OpType
from trimesh import Scene, Trimesh

from agentflow.env.physics.frames import swap, swap_quaternion
from agentflow.env.physics.model import Shape
from agentflow.env.rollout import Array
from agentflow.env.rotations import rotated_axes
from agentflow.env.urdf import name_blocks
from agentflow.errors import UsageError
from agentflow.machine import Geometry, Machine, Problem, library, place
from agentflow.machine.geometry.pieces import build_order
from agentflow.machine.geometry.vectors import Quat, Vec3, add, inverse, rotation_from_up
from agentflow.making.parts import ORIGIN, PRINTED, Making, Part, parts_of, shift_of

SEGMENTS = 180
"""Sides of round bodies: their volume differs by less than 0.1 %."""
TOUCH = 2e-5
"""By how much shapes that become one body are larger on each side, m: what touches, joins."""
CLEARANCE, DEEPER = 0.1, 0.2
"""Gap around a peg, and beyond its end, mm."""
WALL = 0.8
"""Least thickness of what is around a peg or a hole, mm: two lines of a printer."""
FILLED = 0.9
"""Share of these walls that must be there; those of round blocks are a little lower."""


def body(part: Part, scale: float, grown: float = 0.0) -> Any:
    """A part where it goes; `scale` is mm per m, `grown` is added on each side, m."""
    whole = Manifold.batch_boolean(
        [
            placed_at(_primitive(shape, grown), shape.rotation, shape.offset)
            for shape in part.shapes
        ],
        OpType.Add,
    )
    return placed_at(whole, part.rotation, part.at).scale([scale] * 3)


def with_pegs(
    bodies: Mapping[int, Any], geometry: Geometry, scale: float, diameter: float
) -> dict[int, Any]:
    """Bodies with a peg where each is attached to its parent, and a hole there in the parent.

    What only lies on its parent, and two-ended blocks, get none.

    Raises:
        UsageError: A peg does not fit.
    """
    made, shift = dict(bodies), shift_of(geometry)
    for placed in geometry.blocks:
        parent = placed.step.parent
        if parent < 0 or placed.two_ended or library()[placed.type].joint.kind == "loose":
            continue
        at = np.multiply(swap(add(placed.origin, shift)), scale)
        inward = np.array(swap(placed.front))
        peg = _pin(at - diameter * inward, inward, diameter, 2 * diameter)
        hole_depth = diameter + DEEPER
        # it ends above the face: surfaces in one plane leave slivers
        length = hole_depth + DEEPER
        hole = _pin(at - hole_depth * inward, inward, diameter + 2 * CLEARANCE, length)
        wide = diameter + 2 * (CLEARANCE + WALL)
        for block, start, deep in (
            (parent, at - hole_depth * inward, hole_depth),
            (placed.id, at, diameter),
        ):
            around = _pin(start, inward, wide, deep) - _pin(start, inward, diameter, deep)
            if (made[block] ^ around).volume() < FILLED * around.volume():
                raise UsageError(
                    f"pegs of {diameter:g} mm are too thick where {placed.label} joins "
                    f"{geometry[parent].label}: take thinner pegs or make the machine larger"
                )
        made[parent] -= hole
        if library()[placed.type].shape == "caster":  # its fork leans a little into its parent
            made[placed.id] = made[placed.id].trim_by_plane(inward, float(at @ inward))
        made[placed.id] += peg
    return made


def _primitive(shape: Shape, grown: float) -> Any:
    x, y, z = (side + 2 * grown for side in shape.size)
    if shape.kind == "sphere":
        return Manifold.sphere(x / 2, SEGMENTS)
    if shape.kind == "cylinder":
        return Manifold.cylinder(z, x / 2, x / 2, SEGMENTS, center=True)
    return Manifold.cube((x, y, z), center=True)


def placed_at(solid: Any, rotation: Quat, at: Vec3 | Array) -> Any:
    """A body turned, then moved."""
    return solid.transform(np.column_stack((rotated_axes(rotation).T, at)))


def _pin(start: Array, way: Array, diameter: float, length: float) -> Any:
    """A cylinder that begins at a place and leads along one of the axes."""
    pin = Manifold.cylinder(length, diameter / 2, diameter / 2, SEGMENTS)
    return placed_at(pin, swap_quaternion(rotation_from_up(swap(way.tolist()))), start)


GAP = 3.0
"""Between parts that lie side by side, mm."""
DETAILS = (1.0, 0.5, 0.1, 0.02, 2.0, 5.0)
"""Sizes of details that are left out, one after the other, in `TOUCH`."""
SPECK = 1e-3
"""Common volume of bodies that only touch, cubic mm."""

Bodies = Sequence[tuple[str, Any]]


def machine_stl(machine: Machine, making: Making) -> tuple[bytes, tuple[str, ...]]:
    """A valid machine as one body, or its parts side by side; and what is lost."""
    bodies, notes = _bodies(machine, making)
    data: bytes = _mesh(Manifold.compose([each for _, each in bodies]), making).export(
        file_type="stl"
    )
    return data, (*notes, "STL holds shapes alone, without names, colours, masses and joints")


def machine_3mf(machine: Machine, making: Making) -> tuple[bytes, tuple[str, ...]]:
    """A valid machine as one object, or each part as one by its name; and what is lost."""
    bodies, notes = _bodies(machine, making)
    scene = Scene()
    for name, each in bodies:
        scene.add_geometry(_mesh(each, making), node_name=name, geom_name=name)
    data: bytes = scene.export(file_type="3mf")
    return data, (*notes, "3MF holds shapes and names, without colours, masses and joints")


def _mesh(solid: Any, making: Making) -> Trimesh:
    """The surface, to the precision of files: corners that are equal there are one.

    That may join what only comes near, so details are left out until it is watertight.

    Raises:
        UsageError: It is not.
    """
    for share in DETAILS:
        surface = solid.simplify(share * TOUCH * making.millimetres(PRINTED)).to_mesh64()
        points = surface.vert_properties[:, :3].astype(np.float32)
        mesh = Trimesh(points, surface.tri_verts, process=False)
        mesh.merge_vertices()
        a, b, c = mesh.faces.T
        mesh.update_faces((a != b) & (b != c) & (c != a))
        if mesh.is_watertight:
            return mesh
    raise UsageError("it has no watertight surface at this scale: try another one")


def _bodies(machine: Machine, making: Making) -> tuple[Bodies, list[str]]:
    scale = making.millimetres(PRINTED)
    everything = parts_of(machine)
    parts = [part for part in everything if part.kind.connector in (None, "rod")]
    loose = [part.block for part in everything if part not in parts]
    notes = [f"springs and winches are left out: {name_blocks(loose)}"] if loose else []
    if not making.parts:
        grown = [body(part, scale, TOUCH) for part in parts]
        whole = Manifold.batch_boolean(grown, OpType.Add)
        moving = [part.block for part in parts if part.kind.joint.moves]
        if moving:
            notes.append(f"moving joints are rigid: {name_blocks(moving)}")
        if (count := len(whole.decompose())) > 1:
            notes.append(f"the machine is {count} bodies that do not touch each other")
        return [("machine", whole)], [*notes, _size(whole, scale)]
    bodies = {part.block: body(part, scale) for part in parts}
    notes += _cut_rods(machine, parts, bodies)
    if making.pegs is not None:
        geometry = place(machine)
        if isinstance(order := build_order(geometry), Problem):
            raise UsageError(f"its parts could not be put together: {order.message}")
        bodies = with_pegs(bodies, geometry, scale, making.pegs)
    laid = list(_side_by_side([(part, bodies[part.block]) for part in parts]))
    return laid, [*notes, _size(Manifold.compose([each for _, each in laid]), scale)]


def _cut_rods(machine: Machine, parts: Sequence[Part], bodies: dict[int, Any]) -> Iterator[str]:
    """Cut rods where they enter the blocks that they join; notes on what that leaves."""
    rods = [part.block for part in parts if part.kind.linear]
    blocks = [part.block for part in parts if not part.kind.linear]
    casters = [part.block for part in parts if part.kind.shape == "caster"]
    for rod in rods:
        rest = bodies[rod]
        for parent in machine[rod].parents:
            rest -= bodies[parent]
        bodies[rod] = max(rest.decompose(), key=Manifold.volume, default=rest)
    if rods:
        yield f"braces have no pegs and need glue: {name_blocks(rods)}"
    if inside := [rod for rod in rods if bodies[rod].is_empty()]:
        yield f"braces within the blocks that they join are left out: {name_blocks(inside)}"
    through = [  # wheels of casters reach out of their boxes
        one
        for one in (*rods, *casters)
        if any(
            (bodies[one] ^ bodies[other]).volume() > SPECK
            for other in {*blocks}.difference([one], machine[one].parents)
        )
    ]
    if through:
        yield f"what passes through other blocks does not fit as it is: {name_blocks(through)}"


def _side_by_side(parts: Sequence[tuple[Part, Any]]) -> Iterator[tuple[str, Any]]:
    """Parts in rows on z = 0, their fronts down, so that pegs point up; rods lie."""
    turned = [
        (part, placed_at(solid, inverse(part.rotation), ORIGIN).rotate((-90, 0, 0)))
        for part, solid in parts
        if not solid.is_empty()
    ]
    boxes = [np.reshape(solid.bounding_box(), (2, 3)) for _, solid in turned]
    sides = [high - low + GAP for low, high in boxes]
    width = max(sqrt(sum(x * y for x, y, _ in sides)), *(x for x, _, _ in sides))
    x = y = depth = 0.0
    for (part, solid), (low, _), side in zip(turned, boxes, sides, strict=True):
        if x + side[0] > width + SPECK:
            x, y, depth = 0.0, y + depth, 0.0
        yield part.name, solid.translate(np.array((x, y, 0.0)) - low)
        x, depth = x + side[0], max(depth, side[1])


def _size(solid: Any, scale: float) -> str:
    low, high = np.reshape(solid.bounding_box(), (2, 3))
    sides = " x ".join(f"{side:.0f}" for side in high - low)
    return f"the scale is 1 : {1000 / scale:g}, and all of it takes {sides} mm"

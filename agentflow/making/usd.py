"""Machines as USD, the scene file of film and simulation programs: metres, with z up."""

from typing import Any

from pxr import Gf, Usd, UsdGeom, UsdPhysics

from agentflow.env.drawing.glb import linear
from agentflow.env.physics.frames import swap
from agentflow.env.physics.model import Shape
from agentflow.env.urdf import name_blocks
from agentflow.machine import Machine, place
from agentflow.machine.geometry import vectors
from agentflow.machine.geometry.pieces import Bond, extra_bonds, parent_bonds
from agentflow.making.parts import FULL, Making, Part, parts_of, shift_of

_JOINTS = {
    "fixed": UsdPhysics.FixedJoint,
    "revolute": UsdPhysics.RevoluteJoint,
    "prismatic": UsdPhysics.PrismaticJoint,
    "spherical": UsdPhysics.SphericalJoint,
}
AXIS = "Y"
"""Of the frame of a joint: about it, it turns; along it, it slides."""


def machine_usd(machine: Machine, making: Making) -> tuple[bytes, tuple[str, ...]]:
    """A valid machine as one rigid body for each block, with physics joints, and what the file
    cannot hold."""
    size = making.millimetres(FULL) / 1000.0
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/machine").GetPrim())
    parts, geometry = parts_of(machine), place(machine)
    rods = [part.block for part in parts if part.kind.connector not in (None, "rod")]
    for part in parts:
        path = f"/machine/{part.name}"
        group = UsdGeom.Xform.Define(stage, path)
        _put(group, vectors.scale(part.at, size), part.rotation)
        if part.block not in rods:
            UsdPhysics.RigidBodyAPI.Apply(group.GetPrim())
            UsdPhysics.MassAPI.Apply(group.GetPrim()).CreateMassAttr(part.kind.mass)
        color = Gf.Vec3f(*map(linear, part.kind.color[:3]))
        for number, shape in enumerate(part.shapes):
            solid = _primitive(stage, f"{path}/shape_{number}", shape, size)
            _put(solid, vectors.scale(shape.offset, size), shape.rotation)
            if shape.kind == "box":
                solid.AddScaleOp().Set(Gf.Vec3f(*vectors.scale(shape.size, size)))
            solid.CreateDisplayColorAttr([color])
            if part.block not in rods:
                UsdPhysics.CollisionAPI.Apply(solid.GetPrim())
    for number, bond in enumerate((*parent_bonds(geometry), *extra_bonds(geometry))):
        if bond.block not in rods and bond.a // 2 != bond.b // 2:
            _join(stage, number, bond, parts, swap(shift_of(geometry)), size)
    return stage.GetRootLayer().ExportToString().encode(), (
        "the USD file holds shapes, colours, masses and joints, without motors, springs, stops "
        "and strength",
        *([f"springs and winches are loose rods: {name_blocks(rods)}"] if rods else ()),
    )


def _join(
    stage: Any, number: int, bond: Bond, parts: tuple[Part, ...], shift: vectors.Vec3, size: float
) -> None:
    """The joint of a bond, with the same frame in both of its bodies."""
    one, other = parts[bond.a // 2], parts[bond.b // 2]
    moving = bond.kind != "fixed"
    at = vectors.add(swap(bond.pivot), shift) if moving else other.at
    turn = vectors.rotation_from_up(swap(bond.axis)) if moving else vectors.IDENTITY
    joint = _JOINTS[bond.kind].Define(stage, f"/machine/joints/{bond.kind}_{number}")
    if bond.kind in ("revolute", "prismatic"):
        joint.CreateAxisAttr(AXIS)
    for part, body, place_of, turn_of in (
        (one, joint.CreateBody0Rel(), joint.CreateLocalPos0Attr(), joint.CreateLocalRot0Attr()),
        (other, joint.CreateBody1Rel(), joint.CreateLocalPos1Attr(), joint.CreateLocalRot1Attr()),
    ):
        body.SetTargets([f"/machine/{part.name}"])
        back = vectors.inverse(part.rotation)
        place_of.Set(
            Gf.Vec3f(
                *vectors.scale(vectors.rotate_vector(back, vectors.subtract(at, part.at)), size)
            )
        )
        x, y, z, w = vectors.product(back, turn)
        turn_of.Set(Gf.Quatf(w, x, y, z))


def _put(what: Any, at: vectors.Vec3, rotation: vectors.Quat) -> None:
    x, y, z, w = rotation
    what.AddTranslateOp().Set(Gf.Vec3d(*at))
    what.AddOrientOp().Set(Gf.Quatf(w, x, y, z))


def _primitive(stage: Any, path: str, shape: Shape, size: float) -> Any:
    x, _, z = vectors.scale(shape.size, size)
    if shape.kind == "box":
        cube = UsdGeom.Cube.Define(stage, path)
        cube.CreateSizeAttr(1.0)
        return cube
    if shape.kind == "sphere":
        ball = UsdGeom.Sphere.Define(stage, path)
        ball.CreateRadiusAttr(x / 2)
        return ball
    cylinder = UsdGeom.Cylinder.Define(stage, path)
    cylinder.CreateAxisAttr(UsdGeom.Tokens.z)
    cylinder.CreateRadiusAttr(x / 2)
    cylinder.CreateHeightAttr(z)
    return cylinder

"""Machines as USD, the scene file of film and simulation programs: metres, with z up."""

from __future__ import annotations

from typing import Any

from pxr import Gf, Sdf, Usd, UsdGeom

from agentflow.env.drawing.glb import linear
from agentflow.env.export.losses import name_blocks
from agentflow.env.physics.model import Shape
from agentflow.machine.geometry.vectors import Quat, Vec3, scale
from agentflow.machine.tree import Machine
from agentflow.making.parts import parts_of
from agentflow.making.sizes import FULL, Making


def machine_usd(machine: Machine, making: Making) -> tuple[bytes, tuple[str, ...]]:
    """A valid machine as one group of shapes for each block, and what the file cannot hold."""
    size = making.millimetres(FULL) / 1000.0
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/machine").GetPrim())
    parts = parts_of(machine)
    for part in parts:
        path = f"/machine/{part.name}"
        group = UsdGeom.Xform.Define(stage, path)
        _put(group, scale(part.at, size), part.rotation)
        mass = group.GetPrim().CreateAttribute("agentflow:mass", Sdf.ValueTypeNames.Float)
        mass.Set(part.kind.mass)
        color = Gf.Vec3f(*map(linear, part.kind.color[:3]))
        for number, shape in enumerate(part.shapes):
            solid = _primitive(stage, f"{path}/shape_{number}", shape, size)
            _put(solid, scale(shape.offset, size), shape.rotation)
            if shape.kind == "box":
                solid.AddScaleOp().Set(Gf.Vec3f(*scale(shape.size, size)))
            solid.CreateDisplayColorAttr([color])
    rods = [part.block for part in parts if part.kind.connector not in (None, "rod")]
    return stage.GetRootLayer().ExportToString().encode(), (
        "the USD file holds shapes, colours and masses, without joints, motors and strength",
        *([f"springs and winches are rods: {name_blocks(rods)}"] if rods else ()),
    )


def _put(what: Any, at: Vec3, rotation: Quat) -> None:
    x, y, z, w = rotation
    what.AddTranslateOp().Set(Gf.Vec3d(*at))
    what.AddOrientOp().Set(Gf.Quatf(w, x, y, z))


def _primitive(stage: Any, path: str, shape: Shape, size: float) -> Any:
    x, _, z = scale(shape.size, size)
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

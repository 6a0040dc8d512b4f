"""Machines as STEP, the file of CAD programs: an assembly, in millimetres, with z up.

Equal parts are one part with several instances, which are named after their blocks. OpenCASCADE
(OCP) makes the geometry and writes the file.
"""

from functools import reduce
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_Transform
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Quaternion, gp_Trsf, gp_Vec
from OCP.IFSelect import IFSelect_RetDone
from OCP.Interface import Interface_Static
from OCP.Message import Message, Message_PrinterOStream
from OCP.Quantity import Quantity_Color, Quantity_TOC_sRGB
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.STEPControl import STEPControl_AsIs
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDocStd import TDocStd_Document
from OCP.TopLoc import TopLoc_Location
from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool

from agentflow.env.physics.frames import swap
from agentflow.env.physics.model import Shape
from agentflow.env.urdf import name_blocks
from agentflow.machine import Machine, place
from agentflow.machine.geometry.pieces import parent_bonds
from agentflow.machine.geometry.vectors import Quat, Vec3, add
from agentflow.making.parts import FULL, Making, parts_of, shift_of, type_name

AXIS = 1.0
"""Length of the line that shows the axis of a joint, m."""


def machine_step(machine: Machine, making: Making) -> tuple[bytes, tuple[str, ...]]:
    """A valid machine as an assembly, and what the file cannot hold."""
    scale, parts = making.millimetres(FULL), parts_of(machine)
    document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    colors = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    assembly = shapes.NewShape()
    _name(assembly, "machine")
    made: dict[object, Any] = {}
    for part in parts:
        key = part.kind.type, part.shapes
        if key not in made:
            made[key] = shapes.AddShape(_solid(part.shapes, scale), False)
            _name(made[key], type_name(part.kind))
            color = Quantity_Color(*part.kind.color[:3], Quantity_TOC_sRGB)
            colors.SetColor(made[key], color, XCAFDoc_ColorType.XCAFDoc_ColorSurf)
        location = TopLoc_Location(_motion(part.rotation, part.at, scale))
        _name(shapes.AddComponent(assembly, made[key], location), part.name)
    geometry = place(machine)
    for bond in parent_bonds(geometry):
        if bond.kind != "fixed":
            middle = np.array(swap(add(bond.pivot, shift_of(geometry))))
            half = np.array(swap(bond.axis)) * AXIS / 2
            ends = (gp_Pnt(*(scale * (middle + sign * half))) for sign in (-1, 1))
            line = shapes.AddShape(BRepBuilderAPI_MakeEdge(*ends).Edge(), False)
            _name(line, f"{parts[bond.block].name}_{bond.kind}_axis")
            component = shapes.AddComponent(assembly, line, TopLoc_Location())
            _name(component, f"{parts[bond.block].name}_{bond.kind}_axis")
    shapes.UpdateAssemblies()
    rods = [part.block for part in parts if part.kind.connector not in (None, "rod")]
    return _written(document), (
        "STEP holds shapes, colours and axes, without masses, motors, stops and strength",
        *([f"springs and winches are rods: {name_blocks(rods)}"] if rods else ()),
    )


def _name(label: Any, name: str) -> None:
    TDataStd_Name.Set_s(label, TCollection_ExtendedString(name))


def _solid(shapes: tuple[Shape, ...], scale: float) -> Any:
    # not moved by a location: that makes a part an instance of itself, which loses its colour
    solids = [
        BRepBuilderAPI_Transform(
            _primitive(shape, scale), _motion(shape.rotation, shape.offset, scale), True
        ).Shape()
        for shape in shapes
    ]
    return reduce(lambda one, other: BRepAlgoAPI_Fuse(one, other).Shape(), solids)


def _primitive(shape: Shape, scale: float) -> Any:
    x, y, z = (scale * side for side in shape.size)
    if shape.kind == "sphere":
        return BRepPrimAPI_MakeSphere(x / 2).Shape()
    if shape.kind == "cylinder":
        foot = gp_Ax2(gp_Pnt(0, 0, -z / 2), gp_Dir(0, 0, 1))
        return BRepPrimAPI_MakeCylinder(foot, x / 2, z).Shape()
    return BRepPrimAPI_MakeBox(gp_Pnt(-x / 2, -y / 2, -z / 2), x, y, z).Shape()


def _motion(rotation: Quat, at: Vec3, scale: float) -> Any:
    motion = gp_Trsf()
    motion.SetRotation(gp_Quaternion(*rotation))
    motion.SetTranslationPart(gp_Vec(*(scale * part for part in at)))
    return motion


def _written(document: Any) -> bytes:
    writer = STEPCAFControl_Writer()
    Interface_Static.SetCVal_s("write.step.unit", "MM")
    Message.DefaultMessenger_s().RemovePrinters(Message_PrinterOStream.get_type_descriptor_s())
    writer.SetColorMode(True)
    writer.SetNameMode(True)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "machine.step"
        if not writer.Transfer(document, STEPControl_AsIs) or (
            writer.Write(str(file)) != IFSelect_RetDone
        ):
            raise RuntimeError("OpenCASCADE did not write the STEP file")
        return file.read_bytes()

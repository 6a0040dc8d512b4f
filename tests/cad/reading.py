"""Reads files back, with other code than what wrote them, and what blocks should measure."""

from __future__ import annotations

import io
from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agentflow.env.physics.assembly.parts import ROD_DIAMETER, WALL
from agentflow.machine import Machine, library, place

Array = NDArray[np.float64]
WITHOUT_FORMULA = ("caster", "plate")
"""Shapes whose volume has no short formula: two kernels have to agree on it."""


@dataclass(frozen=True)
class Body:
    """What is measured of a body, in m and cubic metres."""

    volume: float
    centre: Array
    color: tuple[float, ...] = ()
    """Linear red, green and blue; () if unknown."""


def expected(machine: Machine) -> dict[str, Body]:
    """Name -> volume and centroid of each block, from the block library alone."""
    geometry = place(machine)
    low, middle = geometry.box_min[1], geometry.middle
    found = {}
    for placed in geometry.blocks:
        kind, aside = library()[placed.type], 0.0
        if placed.end_a is not None and placed.end_b is not None:
            length = float(np.linalg.norm(np.subtract(placed.end_b, placed.end_a)))
            volume = pi * ROD_DIAMETER**2 / 4 * length
        else:
            assert kind.size is not None
            x, y, z = kind.size
            volume = x * y * z
            if kind.shape == "cylinder":
                volume *= pi / 4
            elif kind.shape == "sphere":
                volume *= pi / 6
            elif kind.shape == "container":
                floor = kind.faces[0].position[2]
                stem = 1.0 * 1.0 * (floor - WALL)
                base, rim = x * y * WALL, (x * y - (x - 2 * WALL) * (y - 2 * WALL)) * (z - floor)
                volume = stem + base + rim
                ends = stem * (floor - WALL) / 2, base * (floor - WALL / 2), rim * (z + floor) / 2
                aside = sum(ends) / volume - z / 2
        right, up, ahead = np.add(placed.center, np.multiply(placed.front, aside))
        name = f"block_{placed.id}_{kind.name.lower().replace(' ', '_')}"
        if kind.shape not in WITHOUT_FORMULA:
            centre = np.array((right - middle[0], ahead - middle[2], up - low))
            found[name] = Body(volume, centre)
    return found


def read_step(data: bytes, folder: Path, scale: float) -> tuple[dict[str, Body], dict[str, Array]]:
    """Name -> body of each solid instance, and name -> ends of each axis; lengths in m."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.Quantity import Quantity_Color
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDF import TDF_Label
    from OCP.TDocStd import TDocStd_Document
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_SOLID
    from OCP.TopExp import TopExp, TopExp_Explorer
    from OCP.TopoDS import TopoDS
    from OCP.XCAFDoc import (
        XCAFDoc_ColorSurf,
        XCAFDoc_ColorTool,
        XCAFDoc_DocumentTool,
        XCAFDoc_ShapeTool,
    )

    file = folder / "read.step"
    file.write_bytes(data)
    document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    reader = STEPCAFControl_Reader()
    reader.ReadFile(str(file))
    assert reader.Transfer(document)
    root = XCAFDoc_DocumentTool.ShapesLabel_s(document.Main()).FindChild(1)
    bodies: dict[str, Body] = {}
    axes: dict[str, Array] = {}
    for number in range(1, root.NbChildren() + 1):
        label = root.FindChild(number)
        shape = XCAFDoc_ShapeTool.GetShape_s(label)
        if shape is None or shape.IsNull():
            continue
        attribute = TDataStd_Name()
        assert label.FindAttribute(TDataStd_Name.GetID_s(), attribute)
        name = attribute.Get().ToExtString()
        if TopExp_Explorer(shape, TopAbs_SOLID).More():
            measured = GProp_GProps()
            BRepGProp.VolumeProperties_s(shape, measured)
            at = measured.CentreOfMass()
            centre = np.array((at.X(), at.Y(), at.Z())) / scale
            part, color = TDF_Label(), Quantity_Color()
            assert XCAFDoc_ShapeTool.GetReferredShape_s(label, part)
            known = XCAFDoc_ColorTool.GetColor_s(part, XCAFDoc_ColorSurf, color)
            shown = (color.Red(), color.Green(), color.Blue()) if known else ()
            bodies[name] = Body(measured.Mass() / scale**3, centre, shown)
        else:
            edge = TopoDS.Edge(TopExp_Explorer(shape, TopAbs_EDGE).Current())
            ends = (BRep_Tool.Pnt_s(v(edge)) for v in (TopExp.FirstVertex_s, TopExp.LastVertex_s))
            axes[name] = np.array([(p.X(), p.Y(), p.Z()) for p in ends]) / scale
    assert isinstance(root, TDF_Label)
    return bodies, axes


def read_mesh(data: bytes, form: str) -> dict[str, Any]:
    """Name -> mesh, read by trimesh; of an STL file, one without a name."""
    import trimesh

    read = trimesh.load(io.BytesIO(data), file_type=form)
    return dict(read.geometry) if form == "3mf" else {"": read}


def read_3mf(data: bytes) -> dict[str, float]:
    """Name -> volume in cubic mm of each object, read by lib3mf."""
    import lib3mf
    from lib3mf.Lib3MF import Wrapper

    del lib3mf
    wrapper = Wrapper()
    model = wrapper.CreateModel()
    reader = model.QueryReader("3mf")
    reader.ReadFromBuffer(data)
    found = {}
    meshes = model.GetMeshObjects()
    while meshes.MoveNext():
        mesh = meshes.GetCurrentMeshObject()
        points = np.array([tuple(v.Coordinates) for v in mesh.GetVertices()])
        corners = points[np.array([tuple(t.Indices) for t in mesh.GetTriangleIndices()])]
        found[mesh.GetName()] = float(np.linalg.det(corners).sum() / 6)
        assert mesh.IsManifoldAndOriented()
    return found

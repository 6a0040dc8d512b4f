"""Owns the binary glTF 2.0 container: nodes, meshes by shape and colour, one animation.

What a machine or a rollout consists of is gltf.py's. glTF is right-handed with y up; x changes its
sign on the way in, so that z+ stays where things face.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from math import sqrt
from struct import pack
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from agentflow.env.rollout import Array
from agentflow.env.scene import Thing

Rgba = tuple[float, float, float, float]
Shape = Literal["box", "sphere", "cylinder", "cone"]
Path = Literal["translation", "rotation", "scale"]

FLOAT, UNSIGNED = 5126, 5125
TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
LINE_STRIP = 3
SIDES = 24
MIRROR: Mapping[str, tuple[int, ...]] = {
    "translation": (-1, 1, 1),
    "rotation": (1, -1, -1, 1),
    "scale": (1, 1, 1),
}
_CORNER = sqrt(0.5)
_BENDS = np.linspace(0.0, np.pi, SIDES // 2 + 1)
PROFILES: Mapping[Shape, tuple[int, Array]] = {
    "box": (4, np.array([(0, -0.5), (_CORNER, -0.5), (_CORNER, 0.5), (0, 0.5)])),
    "cylinder": (SIDES, np.array([(0, -0.5), (0.5, -0.5), (0.5, 0.5), (0, 0.5)])),
    "cone": (SIDES, np.array([(0, -0.5), (0.5, -0.5), (0, 0.5)])),
    "sphere": (SIDES, np.stack([np.sin(_BENDS) / 2, -np.cos(_BENDS) / 2], axis=1)),
}
"""Every shape of size 1 as sides around y and the (radius, height) of its rings, upwards."""


class Glb:
    """A file in the making. Vectors and quaternions are given in the game frame."""

    def __init__(self) -> None:
        self._lists: dict[str, list[dict[str, Any]]] = {}
        self._binary = bytearray()
        self._made: dict[object, int] = {}
        self._channels: list[dict[str, Any]] = []
        self._samplers: list[dict[str, Any]] = []

    def node(self, name: str, children: Sequence[int] = (), **fields: Any) -> int:
        """A node; its index. `fields` as in glTF, but in the game frame."""
        entry: dict[str, Any] = {"name": name}
        if children:
            entry["children"] = list(children)
        for key, value in fields.items():
            entry[key] = _mirrored(key, value).tolist() if key in MIRROR else value
        return self._new("nodes", entry)

    def solid(self, thing: Thing, color: Rgba | None = None) -> int:
        """A node that shows a thing where it is, perhaps in another colour."""
        size = (thing.size[0],) * 3 if thing.shape == "sphere" else thing.size
        return self.node(
            thing.name,
            mesh=self._mesh(thing.shape, color or thing.color),
            translation=thing.position,
            rotation=thing.rotation,
            scale=size,
        )

    def line(self, name: str, points: Array, color: Rgba) -> int:
        """A node that shows a line through (K, 3) points."""
        position = self._accessor(_mirrored("translation", points))
        primitive = {
            "attributes": {"POSITION": position},
            "mode": LINE_STRIP,
            "material": self._material(color),
        }
        return self.node(name, mesh=self._new("meshes", {"primitives": [primitive]}))

    def animate(
        self, node: int, path: Path, times: Array, values: Array, *, step: bool = False
    ) -> None:
        """Let a node's place, orientation or size follow (T, 3 or 4) values, or jump to them."""
        key = ("times", times.tobytes())
        if key not in self._made:
            self._made[key] = self._accessor(times[:, None].astype(np.float32))
        sampler = {
            "input": self._made[key],
            "output": self._accessor(_mirrored(path, values)),
            "interpolation": "STEP" if step else "LINEAR",
        }
        self._channels.append(
            {"sampler": len(self._samplers), "target": {"node": node, "path": path}}
        )
        self._samplers.append(sampler)

    def to_bytes(self, roots: Sequence[int]) -> bytes:
        """The file; `roots` are the nodes that hang on no other."""
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "agentflow"},
            "scene": 0,
            "scenes": [{"nodes": list(roots)}],
            **self._lists,
            "buffers": [{"byteLength": len(self._binary)}],
        }
        if self._channels:
            rollout = {"name": "rollout", "channels": self._channels, "samplers": self._samplers}
            document["animations"] = [rollout]
        text = json.dumps(document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = pack("<I4s", len(text), b"JSON") + text
        chunks += pack("<I4s", len(self._binary), b"BIN\0") + self._binary
        return pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def _new(self, kind: str, entry: dict[str, Any]) -> int:
        entries = self._lists.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def _accessor(self, values: NDArray[Any]) -> int:
        """Keep (K, 1, 3 or 4) numbers; four bytes each, so that everything is aligned."""
        view = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": values.nbytes}
        self._binary += values.tobytes()
        entry = {
            "bufferView": self._new("bufferViews", view),
            "componentType": FLOAT if values.dtype == np.float32 else UNSIGNED,
            "count": len(values),
            "type": TYPES[values.shape[1]],
            "min": values.min(axis=0).tolist(),
            "max": values.max(axis=0).tolist(),
        }
        return self._new("accessors", entry)

    def _mesh(self, shape: Shape, color: Rgba) -> int:
        if (shape, color) not in self._made:
            primitive = self._surface(shape) | {"material": self._material(color)}
            entry = {"name": shape, "primitives": [primitive]}
            self._made[shape, color] = self._new("meshes", entry)
        return self._made[shape, color]

    def _surface(self, shape: Shape) -> dict[str, Any]:
        if shape not in self._made:
            points, triangles = _lathed(*PROFILES[shape])
            self._made[shape] = self._accessor(points)
            self._made[shape, "triangles"] = self._accessor(triangles.reshape(-1, 1))
        position, indices = self._made[shape], self._made[shape, "triangles"]
        return {"attributes": {"POSITION": position}, "indices": indices}

    def _material(self, color: Rgba) -> int:
        if color not in self._made:
            linear = [round(_linear(part), 6) for part in color[:3]]
            surface = {"baseColorFactor": [*linear, 1.0], "metallicFactor": 0.0}
            self._made[color] = self._new("materials", {"pbrMetallicRoughness": surface})
        return self._made[color]


def _mirrored(path: str, values: Any) -> NDArray[np.float32]:
    return np.asarray(values * np.array(MIRROR[path]), dtype=np.float32)


def _linear(part: float) -> float:
    """Light of an sRGB colour part, 0..1 (IEC 61966-2-1)."""
    return float(part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4)


def _lathed(sides: int, profile: Array) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """(V, 3) points and (F, 3) triangles, counter-clockwise from outside in glTF's frame."""
    turns = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    radius, height = profile[:, :1], np.repeat(profile[:, 1:], sides, axis=1)
    points = np.stack([radius * np.cos(turns), height, radius * np.sin(turns)], axis=2)
    triangles = []
    for ring in range(len(profile) - 1):
        for side in range(sides):
            a, b = ring * sides + side, ring * sides + (side + 1) % sides
            if profile[ring, 0] > 1e-9:
                triangles.append((a, a + sides, b))
            if profile[ring + 1, 0] > 1e-9:
                triangles.append((b, a + sides, b + sides))
    return points.reshape(-1, 3).astype(np.float32), np.array(triangles, dtype=np.uint32)

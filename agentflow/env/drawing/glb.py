"""Machines and animated rollouts as .glb files: binary glTF 2.0, whose nodes are blocks named by
id and type.

glTF is right-handed with y up; the writer negates x, so that machines still face z+.
"""

import json
from collections.abc import Mapping, Sequence
from math import sqrt
from struct import pack
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from agentflow.env.drawing.film import TRAIL, tracked_block
from agentflow.env.drawing.solids import BROKEN, MachineSolids, Pose
from agentflow.env.rollout import Array, Rollout, Trace
from agentflow.env.rotations import unify_signs
from agentflow.env.scene import Scene, SceneObject
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine, Step

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
"""Each shape of size 1 as a surface of revolution: sides around y, and (radius, height) of its
rings from bottom to top."""


class Glb:
    """Builder of one file. Takes vectors and quaternions in the game frame."""

    def __init__(self) -> None:
        self._lists: dict[str, list[dict[str, Any]]] = {}
        self._binary = bytearray()
        self._cache: dict[object, int] = {}
        self._channels: list[dict[str, Any]] = []
        self._samplers: list[dict[str, Any]] = []

    def node(self, name: str, children: Sequence[int] = (), **fields: Any) -> int:
        """Add a node and return its index. `fields` as in glTF, but in the game frame."""
        entry: dict[str, Any] = {"name": name}
        if children:
            entry["children"] = list(children)
        for key, value in fields.items():
            entry[key] = _to_gltf(key, value).tolist() if key in MIRROR else value
        return self._append("nodes", entry)

    def solid(self, item: SceneObject, color: Rgba | None = None) -> int:
        """Add a node that shows an object, optionally in another colour."""
        size = (item.size[0],) * 3 if item.shape == "sphere" else item.size
        return self.node(
            item.name,
            mesh=self._mesh(item.shape, color or item.color),
            translation=item.position,
            rotation=item.rotation,
            scale=size,
        )

    def line(self, name: str, points: Array, color: Rgba) -> int:
        """Add a node that shows a line through (K, 3) points."""
        position = self._accessor(_to_gltf("translation", points))
        primitive = {
            "attributes": {"POSITION": position},
            "mode": LINE_STRIP,
            "material": self._material(color),
        }
        return self.node(name, mesh=self._append("meshes", {"primitives": [primitive]}))

    def animate(
        self, node: int, path: Path, times: Array, values: Array, *, step: bool = False
    ) -> None:
        """Animate a node's translation, rotation or scale with (T, 3 or 4) values.

        Args:
            node: Index of the node.
            path: Property to animate.
            times: (T,) s.
            values: One row per time.
            step: Jump to each value instead of interpolating.
        """
        key = ("times", times.tobytes())
        if key not in self._cache:
            self._cache[key] = self._accessor(times[:, None].astype(np.float32))
        sampler = {
            "input": self._cache[key],
            "output": self._accessor(_to_gltf(path, values)),
            "interpolation": "STEP" if step else "LINEAR",
        }
        self._channels.append(
            {"sampler": len(self._samplers), "target": {"node": node, "path": path}}
        )
        self._samplers.append(sampler)

    def move(self, node: int, times: Array, places: Array, turns: Array) -> None:
        """Animate where a node is, (T, 3) m, and how it is turned, (T, 4) quaternions."""
        self.animate(node, "translation", times, places)
        self.animate(node, "rotation", times, unify_signs(turns))

    def to_bytes(self, roots: Sequence[int]) -> bytes:
        """Contents of the file; `roots` are the nodes without a parent."""
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

    def _append(self, kind: str, entry: dict[str, Any]) -> int:
        entries = self._lists.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def _accessor(self, values: NDArray[Any]) -> int:
        """Store a (K, 1, 3 or 4) array; four bytes per number keep everything aligned."""
        view = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": values.nbytes}
        self._binary += values.tobytes()
        entry = {
            "bufferView": self._append("bufferViews", view),
            "componentType": FLOAT if values.dtype == np.float32 else UNSIGNED,
            "count": len(values),
            "type": TYPES[values.shape[1]],
            "min": values.min(axis=0).tolist(),
            "max": values.max(axis=0).tolist(),
        }
        return self._append("accessors", entry)

    def _mesh(self, shape: Shape, color: Rgba) -> int:
        if (shape, color) not in self._cache:
            primitive = self._surface(shape) | {"material": self._material(color)}
            entry = {"name": shape, "primitives": [primitive]}
            self._cache[shape, color] = self._append("meshes", entry)
        return self._cache[shape, color]

    def _surface(self, shape: Shape) -> dict[str, Any]:
        if shape not in self._cache:
            points, triangles = _revolve(*PROFILES[shape])
            self._cache[shape] = self._accessor(points)
            self._cache[shape, "triangles"] = self._accessor(triangles.reshape(-1, 1))
        position, indices = self._cache[shape], self._cache[shape, "triangles"]
        return {"attributes": {"POSITION": position}, "indices": indices}

    def _material(self, color: Rgba) -> int:
        if color not in self._cache:
            parts = [round(linear(part), 6) for part in color[:3]]
            surface = {"baseColorFactor": [*parts, 1.0], "metallicFactor": 0.0}
            self._cache[color] = self._append("materials", {"pbrMetallicRoughness": surface})
        return self._cache[color]


def _to_gltf(path: str, values: Any) -> NDArray[np.float32]:
    return np.asarray(values * np.array(MIRROR[path]), dtype=np.float32)


def linear(part: float) -> float:
    """Linear value of an sRGB colour component, 0 to 1 (IEC 61966-2-1)."""
    return float(part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4)


def _revolve(sides: int, profile: Array) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """(V, 3) points and (F, 3) triangles of a surface of revolution.

    Triangles are counter-clockwise when seen from outside, in glTF's frame.
    """
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
        glb.move(node, trace.times, trace.centre[:, step.id], trace.rotation[:, step.id])
        return
    rods = [shapes.rod(step.id, pose) for pose in poses]
    turns = np.array([rod.rotation for rod in rods])
    connected = trace.alive[:, [step.id]]
    sizes = np.where(connected, np.array([rod.size for rod in rods]), HIDDEN)
    glb.move(node, trace.times, np.array([rod.position for rod in rods]), turns)
    glb.animate(node, "scale", trace.times, sizes)


def _scene(glb: Glb, scene: Scene, trace: Trace) -> int:
    """Add the scene's objects, animated if they move."""
    nodes = []
    for item in scene.objects:
        nodes.append(glb.solid(item))
        if item.name in trace.objects:
            at = (slice(None), trace.objects.index(item.name))
            glb.move(nodes[-1], trace.times, trace.object_position[at], trace.object_rotation[at])
    return glb.node("scene", nodes)

"""Three-dimensional files, parsed back: blocks, places, the animation, what turns red and when."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from struct import unpack_from
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from agentflow.env.drawing.glb import machine_glb, rollout_glb
from agentflow.env.drawing.solids import MachineSolids
from agentflow.env.rollout import Broken, Rollout
from agentflow.env.rotations import rotate
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from tests.env.machines import BALLASTED, machine

SPRUNG = machine(
    (0, -1, -1), (1, 0, 0), (1, 0, 1), (2, 1, 1), (2, 1, 3), (2, 2, 1), (2, 2, 3), (9, 1, 4, 2, 4)
)
WIDTH = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
MIRROR = (-1.0, 1.0, 1.0)


class Parsed:
    """A .glb file, read by the specification (glTF 2.0, 4.4 and 3.6)."""

    def __init__(self, data: bytes) -> None:
        magic, version, length = unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = unpack_from("<I4s", data, 12)
        assert (kind, size % 4) == (b"JSON", 0)
        self.json: dict[str, Any] = json.loads(data[20 : 20 + size])
        rest, kind = unpack_from("<I4s", data, 20 + size)
        assert (kind, rest % 4) == (b"BIN\0", 0)
        self.binary = data[28 + size :]
        assert len(self.binary) == rest == self.json["buffers"][0]["byteLength"]

    def array(self, accessor: int) -> NDArray[Any]:
        entry = self.json["accessors"][accessor]
        view = self.json["bufferViews"][entry["bufferView"]]
        kind = {5126: np.float32, 5125: np.uint32}[entry["componentType"]]
        width = WIDTH[entry["type"]]
        flat = np.frombuffer(self.binary, kind, entry["count"] * width, view["byteOffset"])
        table = flat.reshape(-1, width)
        assert table.min(axis=0).tolist() == entry["min"]
        assert table.max(axis=0).tolist() == entry["max"]
        return table

    @property
    def blocks(self) -> dict[int, int]:
        """Node of each block."""
        nodes = enumerate(self.json["nodes"])
        return {node["extras"]["block"]: index for index, node in nodes if "extras" in node}

    def follows(self, node: int, path: str) -> tuple[NDArray[Any], NDArray[Any]]:
        """Times and values of what animates a node."""
        (animation,) = self.json["animations"]
        (sampler,) = (
            animation["samplers"][channel["sampler"]]
            for channel in animation["channels"]
            if channel["target"] == {"node": node, "path": path}
        )
        return self.array(sampler["input"])[:, 0], self.array(sampler["output"])


@cache
def throw() -> tuple[Task, Rollout]:
    task = get_task("throwing", {"window": 1})
    rollout = simulate(BALLASTED, task, interval=0.1)
    assert rollout.trace is not None
    return task, rollout


def test_a_machine_has_a_node_per_block_where_it_is() -> None:
    parsed = Parsed(machine_glb(SPRUNG))
    nodes, rest = parsed.json["nodes"], MachineSolids(SPRUNG).rest
    assert list(parsed.blocks) == list(range(8))
    for block, index in parsed.blocks.items():
        if block != 7:
            assert nodes[index]["translation"] == pytest.approx(rest.centre[block] * MIRROR)
    assert nodes[parsed.blocks[0]]["name"] == "block 0 Starting Block"
    assert nodes[parsed.blocks[3]]["extras"] == {"block": 3, "type": 2}
    assert nodes[parsed.blocks[7]]["scale"] == pytest.approx([0.18, 17**0.5, 0.18])
    assert "animations" not in parsed.json
    (root,) = parsed.json["scenes"][0]["nodes"]
    assert nodes[root]["children"] == list(parsed.blocks.values())


def test_turning_in_the_file_is_the_mirror_image_of_turning_in_the_game() -> None:
    parsed, rest = Parsed(machine_glb(BALLASTED)), MachineSolids(BALLASTED).rest
    for block, index in parsed.blocks.items():
        turned = rotate(np.tile(parsed.json["nodes"][index]["rotation"], (3, 1)), np.eye(3))
        expected = rotate(np.tile(rest.rotation[block], (3, 1)), np.diag(MIRROR)) * MIRROR
        assert turned == pytest.approx(expected, abs=1e-6)


def test_surfaces_are_closed_and_face_outwards() -> None:
    parsed, volumes = Parsed(machine_glb(BALLASTED)), {}
    for mesh in parsed.json["meshes"]:
        (primitive,) = mesh["primitives"]
        points = parsed.array(primitive["attributes"]["POSITION"])
        corners = points[parsed.array(primitive["indices"]).reshape(-1, 3)].astype(float)
        products = np.cross(corners[:, 0], corners[:, 1]) * corners[:, 2]
        volumes[mesh["name"]] = products.sum() / 6
    assert volumes["box"] == pytest.approx(1.0)
    assert volumes["cylinder"] == pytest.approx(np.pi / 4, rel=0.02)
    assert volumes["sphere"] == pytest.approx(np.pi / 6, rel=0.04)


def test_a_rollout_is_animated_from_its_first_to_its_last_sample() -> None:
    task, rollout = throw()
    trace = rollout.trace
    assert trace is not None
    parsed = Parsed(rollout_glb(BALLASTED, rollout))
    assert len(parsed.blocks) == len(BALLASTED)
    for block, node in parsed.blocks.items():
        times, places = parsed.follows(node, "translation")
        assert times == pytest.approx(trace.times)
        assert places == pytest.approx(trace.centre[:, block] * MIRROR, abs=1e-5)
        turns = parsed.follows(node, "rotation")[1]
        assert (np.sum(turns[1:] * turns[:-1], axis=1) >= 0).all()
    names = [node["name"] for node in parsed.json["nodes"]]
    assert {item.name for item in task.scene().objects} <= set(names)
    (line,) = (mesh for mesh in parsed.json["meshes"] if mesh["primitives"][0].get("mode") == 3)
    points = parsed.array(line["primitives"][0]["attributes"]["POSITION"])
    assert points == pytest.approx(trace.centre[:, 13] * MIRROR, abs=1e-5)


def test_broken_blocks_turn_red_at_the_moment_they_break() -> None:
    _, rollout = throw()
    first = Broken(block=4, type=1, partner=1, time=0.43, load=1.2)
    later = Broken(block=4, type=1, partner=9, time=0.8, load=1.2)
    parsed = Parsed(rollout_glb(BALLASTED, replace(rollout, broken=(first, later))))
    nodes = parsed.json["nodes"]
    whole, broken = nodes[parsed.blocks[4]]["children"]
    assert (nodes[whole]["name"], nodes[broken]["name"]) == ("whole", "broken")
    for node, sizes in ((whole, (1.0, 0.0)), (broken, (0.0, 1.0))):
        times, values = parsed.follows(node, "scale")
        assert times == pytest.approx([0.0, 0.43])
        assert values[:, 0].tolist() == list(sizes)
    (solid,) = nodes[broken]["children"]
    (primitive,) = parsed.json["meshes"][nodes[solid]["mesh"]]["primitives"]
    surface = parsed.json["materials"][primitive["material"]]["pbrMetallicRoughness"]
    assert surface["baseColorFactor"][0] > 10 * max(surface["baseColorFactor"][1:3])


def test_a_spring_that_lets_go_vanishes() -> None:
    task = get_task("movement", {"window": 1})
    rollout = simulate(SPRUNG, task, interval=0.2)
    assert rollout.trace is not None
    alive = rollout.trace.alive.copy()
    alive[3:, 7] = False
    gone = replace(rollout, trace=replace(rollout.trace, alive=alive))
    parsed = Parsed(rollout_glb(SPRUNG, gone))
    _, sizes = parsed.follows(parsed.blocks[7], "scale")
    assert (sizes[:3] > 0).all()
    assert (sizes[3:] == 0).all()


def test_a_file_has_the_same_bytes_every_time() -> None:
    _, rollout = throw()
    assert rollout_glb(BALLASTED, rollout) == rollout_glb(BALLASTED, rollout)

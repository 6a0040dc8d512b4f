"""URDF files, read back by two libraries: masses, axes, and poses of moved joints."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import pi
from pathlib import Path
from random import Random
from xml.etree import ElementTree

import numpy as np
import pytest

from agentflow.app.machines.files import read_one
from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.frames import swap, swap_turn
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.readings import joint_motion
from agentflow.env.physics.structure.drives import merge_drives
from agentflow.env.physics.structure.spanning_tree import Skeleton, skeleton
from agentflow.env.rollout import Array
from agentflow.env.rotations import compose, rotate
from agentflow.env.urdf import machine_urdf, roll_pitch_yaw, train_leaders
from agentflow.errors import UsageError
from agentflow.machine.blocks.library import library
from agentflow.machine.edits.random import random_machine
from agentflow.machine.geometry.gears import gear_trains, meshing_pairs
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine
from tests.env.export.robots import Link, read_by_pybullet, read_by_yourdfpy
from tests.env.machines import CAR, CRADLE, FOLDER, machine

JOINTS = machine(
    *((0, -1, -1), (50, 0, 0), (86, 0, 1), (5, 0, 2), (15, 3, 0), (28, 0, 3), (13, 0, 4)),
    *((63, 5, 0), (16, 7, 0), (22, 8, 0)),
)
"""Casters, hinge, steering hinge, steering block, suspension and rotating block."""
BALLS = machine((0, -1, -1), (44, 0, 0), (44, 0, 1), (7, 1, 0, 2, 0))
"""A brace between two ball joints, which close a loop."""
MACHINES = {
    "car": CAR,
    "joints": JOINTS,
    **{
        name: read_one(str(FOLDER / f"{name}.json"))
        for name in ("sprung_car", "gearing/fork", "gearing/locked_loop", "jumping/tossing_arm")
    },
}
READERS = [
    pytest.param(read_by_pybullet, marks=pytest.mark.pybullet),
    pytest.param(read_by_yourdfpy, marks=pytest.mark.slow),
]
Read = Callable[[Path, Mapping[str, float]], dict[str, Link]]


def built(tree: Machine) -> tuple[Assembly, Skeleton]:
    assembly = assemble(tree, place(tree), constants())
    return assembly, skeleton(len(assembly.parts), assembly.joints)


def names_of(tree: Machine, assembly: Assembly) -> list[str]:
    """The name of each part's link."""
    names = []
    for part in assembly.parts:
        name = library()[tree[part.block].type].name.lower().replace(" ", "_")
        names.append(f"block_{part.block}_{name}")
        if count := names[:-1].count(names[-1]):
            names[-1] += f"_{count}"
    return names


def agree(read: Read, folder: Path, tree: Machine, rng: Random) -> int:
    """Compare what a library reads with the parts and joints: masses, moments, centres, kinds and
    axes at rest. Then move the joints; the poses of the parts give back their positions.

    Returns the number of joints that moved."""
    (folder / "machine.urdf").write_bytes(machine_urdf(tree)[0])
    assembly, plan = built(tree)
    names = names_of(tree, assembly)
    links = read(folder / "machine.urdf", {})
    for name, part in zip(names, assembly.parts, strict=True):
        assert links[name].mass == pytest.approx(part.mass, rel=1e-5)
        assert links[name].inertia == pytest.approx(swap(part.inertia), rel=1e-5)
        assert links[name].centre == pytest.approx(swap(part.centre), abs=1e-9)
    total = sum(part.mass for part in assembly.parts)
    assert sum(link.mass for link in links.values()) == pytest.approx(total, rel=1e-11)
    told = {}
    for up in plan.links:
        joint, link = assembly.joints[up.joint], links[names[up.part]]
        if up.rigid or joint.kind == "fixed":
            assert link.kind == "fixed"
        elif joint.kind != "spherical":
            stops = merge_drives(assembly.joints, up).stops
            assert link.kind == (joint.kind if stops else "continuous")
            image = swap(joint.axis) if joint.kind == "prismatic" else swap_turn(joint.axis)
            sign = -1.0 if up.reversed else 1.0
            assert link.axis == pytest.approx([sign * x for x in image], abs=1e-9)
            told[up.joint] = rng.uniform(-0.5, 0.1)
    told |= {i: ratio * told[lead] for i, (lead, ratio) in train_leaders(assembly, plan).items()}
    moved = {names[up.part]: told[up.joint] for up in plan.links if up.joint in told}
    links = read(folder / "machine.urdf", moved)
    poses = [links[name] for name in names]
    rows = np.array([[*link.centre, *link.rotation, *[0.0] * 6] for link in poses])
    for i, position in told.items():
        found, _ = joint_motion(assembly.joints[i], assembly.parts, rows)
        assert found == pytest.approx(position, abs=1e-9)
    return len(told)


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize("name", MACHINES)
def test_other_libraries_read_what_engines_get(name: str, read: Read, tmp_path: Path) -> None:
    assert agree(read, tmp_path, MACHINES[name], Random(name)) > 0


@pytest.mark.slow
@pytest.mark.pybullet
def test_random_machines(tmp_path: Path) -> None:
    rng, flipped, moved = Random(5), 0, 0
    for _ in range(40):
        tree = random_machine(rng, size=(5, 20))
        _, plan = built(tree)
        if len(plan.pieces) == 1:
            moved += agree(read_by_pybullet, tmp_path, tree, rng)
            flipped += sum(up.reversed for up in plan.links)
    assert (moved > 50, flipped > 0) == (True, True)


@pytest.mark.parametrize("read", READERS)
def test_a_ball_joint_turns_about_all_axes(read: Read, tmp_path: Path) -> None:
    tree = machine((0, -1, -1), (44, 0, 4), (63, 1, 0))
    agree(read, tmp_path, tree, Random(1))
    ball, log = "block_1_ball_joint", "block_2_log"
    before = read(tmp_path / "machine.urdf", {})[log]
    after = read(tmp_path / "machine.urdf", {f"{ball}_x": 0.3, f"{ball}_y": -0.4, ball: 0.5})[log]
    turned = compose(about("x", 0.3), compose(about("y", -0.4), about("z", 0.5)))
    assert abs(after.rotation @ turned) == pytest.approx(1.0, abs=1e-9)
    pivot = np.array(swap(built(tree)[0].joints[0].pivot))
    arms = rotate(turned, before.centre - pivot), after.centre - pivot
    assert arms[0] == pytest.approx(arms[1], abs=1e-9)


def test_angles_of_any_orientation() -> None:
    rng = np.random.default_rng(3)
    tilts = [(0.0, 0.7071067811865476 * sign, 0.0, 0.7071067811865476) for sign in (1.0, -1.0)]
    for turn in [*(q / np.linalg.norm(q) for q in rng.normal(size=(50, 4))), *map(np.array, tilts)]:
        roll, pitch, yaw = roll_pitch_yaw(tuple(turn))
        back = compose(about("z", yaw), compose(about("y", pitch), about("x", roll)))
        assert abs(back @ turn) == pytest.approx(1.0, abs=1e-12)


def about(axis: str, angle: float) -> Array:
    return np.array([*(np.sin(angle / 2) * (axis == each) for each in "xyz"), np.cos(angle / 2)])


def joint_of(tree: Machine, block: int) -> ElementTree.Element:
    joints = ElementTree.fromstring(machine_urdf(tree)[0]).findall("joint")
    (found,) = (j for j in joints if j.get("name", "").startswith(f"block_{block}_"))
    return found


def attributes(tree: Machine, block: int, name: str) -> dict[str, str]:
    element = joint_of(tree, block).find(name)
    assert element is not None
    return element.attrib


def test_motors_stops_and_friction() -> None:
    wheel, hinge, suspension = attributes(CAR, 3, "limit"), attributes(JOINTS, 3, "limit"), 8
    assert wheel == {"effort": "40", "velocity": "10"}
    assert [hinge["effort"], hinge["velocity"]] == ["0", "500"]
    assert [float(hinge["lower"]), float(hinge["upper"])] == pytest.approx([-pi / 2, pi / 2])
    assert attributes(JOINTS, 3, "dynamics") == {"damping": "0", "friction": "0.6"}
    assert joint_of(JOINTS, suspension).get("type") == "prismatic"
    assert attributes(JOINTS, suspension, "dynamics") == {"damping": "60", "friction": "0"}
    assert attributes(JOINTS, suspension, "limit")["lower"] == "-0.6"
    text = machine_urdf(CAR)[0].decode()
    assert text.count("<!-- motor: +10 rad/s, at most 40 N m -->") == 2
    assert text.count("<!-- motor: -10 rad/s, at most 40 N m -->") == 2


def test_cogs_follow_the_powered_one() -> None:
    fork = MACHINES["gearing/fork"]
    assert joint_of(fork, 1).find("mimic") is None
    blocks = place(fork).blocks
    cogs = [block.id for block in blocks if library()[block.type].pitch_radius is not None]
    (train,) = gear_trains(cogs, meshing_pairs(blocks, 0.1))
    assert len(train.speeds) == len(cogs) == 10
    for block in set(cogs) - {1}:
        mimic = attributes(fork, block, "mimic")
        assert mimic["joint"] == "block_1_powered_cog_joint"
        assert float(mimic["multiplier"]) == pytest.approx(train.speeds[block])


def test_what_the_file_cannot_hold_is_said_in_it() -> None:
    data, notes = machine_urdf(BALLS)
    assert notes == (
        "URDF does not hold air drag, friction between surfaces, or the strength of connections",
        "URDF does not hold joints that close loops, which are open: block 2",
        "ball joints are hinges about x, y and z in series: block 1",
    )
    assert all(f"<!-- {note} -->" in data.decode() for note in notes)
    sprung, _ = machine_urdf(MACHINES["sprung_car"])
    assert b"URDF does not hold the springs of suspensions: blocks 3, 4 " in sprung
    assert any(
        note.startswith("URDF does not hold the pull of springs")
        for note in machine_urdf(MACHINES["jumping/tossing_arm"])[1]
    )


def test_a_machine_in_pieces_is_refused() -> None:
    with pytest.raises(UsageError, match=r"no joint connects block 6 to block 0; remove what is "):
        machine_urdf(CRADLE)


def test_equal_machines_give_equal_files() -> None:
    assert machine_urdf(JOINTS) == machine_urdf(JOINTS)

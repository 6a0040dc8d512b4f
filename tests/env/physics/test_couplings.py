"""Cogs that mesh, lock and slip out; joints that close loops keep their axes."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.assembly.devices import cog_meshes
from agentflow.env.physics.engine import Engine
from agentflow.env.physics.model import Assembly, CogMesh, Joint, JointKind, Part, Shape
from agentflow.env.physics.structure.load_sharing import load_loops
from agentflow.env.physics.structure.spanning_tree import skeleton
from agentflow.env.rollout import Array
from agentflow.env.scene import Scene
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import IDENTITY, Vec3
from agentflow.machine.tree import Machine
from tests.env.conftest import MakeEngine
from tests.env.machines import Row, machine
from tests.env.physics.rig import FACINGS, RATE, Rig, face_towards

ROOT = (0, -1, -1)
MEDIUM, POWERED, LARGE = 38, 39, 51
DRIVEN = 2.0
"""rad/s of a powered cog."""


def row_of(facing: str, *kinds: int, gap: int = 2) -> tuple[Machine, list[int]]:
    """Cogs on one beam that all face there, `gap` metres from axle to axle, and their ids."""
    along = {"z": "x+", "x": "z+", "y": "z+"}[facing[0]]
    start = next(i for i in range(6) if FACINGS[i] == along)
    rows: list[Row] = [ROOT, (15, 0, start)]
    rows += [(15, i, 0) for i in range(1, gap * (len(kinds) - 1))]
    tree = machine(*rows)
    cogs = []
    for i, kind in enumerate(kinds):
        carrier = i * gap
        rows.append((kind, carrier, face_towards(tree, carrier, facing)))
        cogs.append(len(rows) - 1)
    return machine(*rows), cogs


@pytest.mark.parametrize("facing", FACINGS)
def test_cogs_mesh_at_equal_and_opposite_speed(calm: Engine, facing: str) -> None:
    tree, cogs = row_of(facing, POWERED, MEDIUM, MEDIUM)
    rig = Rig(calm, tree)
    assert [mesh.ratio for mesh in rig.assembly.devices.cog_meshes] == [1.0, 1.0]
    rig.run(0.2)
    rig.world.switch("motors", 1)
    rig.run(1.0)
    front = rig.blocks[cogs[0]].front
    turned = [rig.spin(cog, front) for cog in cogs]
    assert turned == pytest.approx([DRIVEN, -DRIVEN, DRIVEN], rel=1e-3)
    angles = [rig.angle(cog, front) for cog in cogs]
    assert angles == pytest.approx([2.0, -2.0, 2.0], abs=0.05)


@pytest.mark.parametrize("facing", FACINGS)
def test_large_cogs_mesh(calm: Engine, facing: str) -> None:
    """Their axles are 5 m apart: two pitch radii of 2.5 m."""
    tree, _ = row_of(facing, LARGE, LARGE, gap=5)
    assert [mesh.ratio for mesh in Rig(calm, tree).assembly.devices.cog_meshes] == [1.0]


def coupled(tree: Machine, *pairs: tuple[int, int, float]) -> Assembly:
    """An assembly whose cogs mesh as told, wherever they sit."""
    assembly = assemble(tree, place(tree), constants())
    joint = {joint.block: i for i, joint in enumerate(assembly.joints)}
    meshing = tuple(CogMesh(joint[a], joint[b], ratio) for a, b, ratio in pairs)
    return replace(assembly, devices=replace(assembly.devices, cog_meshes=meshing))


@pytest.mark.parametrize("facing", FACINGS)
def test_speeds_go_inversely_as_the_radii(calm: Engine, facing: str) -> None:
    """On a plate of the gearing task their axles are 3.5 m apart; here the ratio is given."""
    tree, (small, large) = row_of(facing, POWERED, LARGE, gap=4)
    rig = Rig(calm, tree, assembly=coupled(tree, (small, large, 2.5)))
    rig.world.switch("motors", 1)
    rig.run(1.5)
    front = rig.blocks[small].front
    assert rig.spin(small, front) == pytest.approx(DRIVEN, rel=1e-3)
    assert rig.spin(large, front) == pytest.approx(-DRIVEN / 2.5, rel=1e-3)


@pytest.mark.parametrize(
    ("first", "second", "apart", "aside", "turned", "ratio"),
    [
        (MEDIUM, MEDIUM, 2.0, 0.0, False, 1.0),
        (MEDIUM, MEDIUM, 2.1, 0.0, False, 1.0),
        (MEDIUM, MEDIUM, 2.15, 0.0, False, None),
        (MEDIUM, LARGE, 3.5, 0.0, False, 2.5),
        (LARGE, MEDIUM, 3.5, 0.0, False, 0.4),
        (LARGE, LARGE, 5.0, 0.05, False, 1.0),
        (MEDIUM, MEDIUM, 2.0, 0.5, False, None),
        (MEDIUM, MEDIUM, 2.0, 0.0, True, -1.0),
    ],
)
def test_which_cogs_mesh(
    first: int, second: int, apart: float, aside: float, turned: bool, ratio: float | None
) -> None:
    """Pitch circles that touch within 0.1 in one plane; face to face they count turns apart."""
    tree = machine(ROOT, (15, 0, 2), (first, 0, 4), (second, 1, 3))
    blocks = list(place(tree).blocks)
    assembly = assemble(tree, place(tree), constants())

    class Moved:
        def __init__(self, block: object, center: object, front: object) -> None:
            self.id, self.type = block.id, block.type  # type: ignore[attr-defined]
            self.center, self.front = center, front

    x, y, z = blocks[2].center
    cogs = [
        Moved(blocks[2], (x, y, z), (0.0, 1.0, 0.0)),
        Moved(blocks[3], (x + apart, y + aside, z), (0.0, -1.0 if turned else 1.0, 0.0)),
    ]
    found = cog_meshes([*blocks[:2], *cogs], assembly.joints, 0.1)  # type: ignore[list-item]
    assert [mesh.ratio for mesh in found] == ([] if ratio is None else [pytest.approx(ratio)])


def test_a_conflicting_loop_locks(calm: Engine) -> None:
    """Three cogs each in each other's teeth: none can turn, whatever drives one of them."""
    tree, cogs = row_of("y+", POWERED, MEDIUM, MEDIUM)
    rig = Rig(calm, tree, assembly=coupled(tree, *((a, b, 1.0) for a, b in combinations(cogs, 2))))
    rig.world.switch("motors", 1)
    rig.run(2.0)
    front = rig.blocks[cogs[0]].front
    assert [rig.spin(cog, front) for cog in cogs] == pytest.approx([0.0] * 3, abs=0.01)
    assert [rig.angle(cog, front) for cog in cogs] == pytest.approx([0.0] * 3, abs=0.01)


def test_two_powered_cogs_in_each_other_stall(calm: Engine) -> None:
    tree, cogs = row_of("y+", POWERED, POWERED)
    rig = Rig(calm, tree)
    rig.world.switch("motors", 1)
    rig.run(1.0)
    front = rig.blocks[cogs[0]].front
    assert [rig.spin(cog, front) for cog in cogs] == pytest.approx([0.0, 0.0], abs=0.01)


def test_a_cog_that_broke_off_meshes_no_more(calm: Engine) -> None:
    tree, cogs = row_of("y+", POWERED, MEDIUM, MEDIUM)
    rig = Rig(calm, tree)
    rig.world.switch("motors", 1)
    rig.run(0.5)
    rig.world.split([i for i, joint in enumerate(rig.assembly.joints) if joint.block == cogs[1]])
    rig.run(0.5)
    front = rig.blocks[cogs[0]].front
    assert rig.spin(cogs[0], front) == pytest.approx(DRIVEN, rel=1e-3)
    assert rig.spin(cogs[2], front) < 0.9 * DRIVEN


def doors() -> Machine:
    """A beam on two hinges in one line: the second hinge closes a loop by an auto-connection."""
    uprights = (ROOT, (15, 0, 2), (15, 1, 0), (5, 0, 4), (5, 2, 3), (15, 3, 0), (15, 4, 0))
    return machine(*uprights, (15, 5, 1))


def test_a_beam_on_two_hinges_in_line_swings(calm: Engine) -> None:
    tree = doors()
    assert [(link.block, link.partner) for link in place(tree).auto_connections]
    rig = Rig(calm, tree, wind=(0.0, -4.0, 12.0))
    rig.run(3.0)
    assert abs(rig.angle(5, (1.0, 0.0, 0.0))) == pytest.approx(np.pi / 2, abs=0.03)


def test_parallel_suspensions_share_the_load(calm: Engine) -> None:
    """With both, the deck yields half as far. Later the wind would turn the anchor."""
    value = constants()
    posts = (ROOT, (15, 0, 2), (15, 1, 0), (16, 0, 4), (16, 2, 3), (15, 3, 0))
    tree = machine(*posts, (15, 5, 1), (15, 6, 0))
    assert [(link.block, link.partner) for link in place(tree).auto_connections] == [(4, 7)]
    rig = Rig(calm, tree, wind=(0.0, -15.0, 0.0))
    rig.run(0.6)
    push = 0.6 * 15.0**2 * 5.0
    expected = -push / (2 * value["suspension_stiffness"])
    for block in (5, 6, 7):
        assert rig.moved(block) == pytest.approx([0.0, expected, 0.0], rel=0.02, abs=3e-3)


def test_a_motor_turns_what_a_free_joint_holds_too(calm: Engine) -> None:
    """A beam between a universal joint and, by its auto-connection, a rotating block."""
    rows = (ROOT, (15, 0, 2), (63, 0, 4), (15, 1, 0), (15, 3, 0), (15, 4, 0))
    rows += ((63, 5, face_towards(machine(*rows), 5, "y+")),)
    rows += ((19, 2, face_towards(machine(*rows), 2, "x-") + 2),)
    rows += ((22, 6, face_towards(machine(*rows), 6, "x+") + 2),)
    rows += ((15, 7, 0),)
    tree = machine(*rows)
    assert [(link.block, link.partner) for link in place(tree).auto_connections] == [(8, 9)]
    rig = Rig(calm, tree)
    assert len(list(skeleton(len(rig.assembly.parts), rig.assembly.joints).parallel)) == 1
    rig.world.switch("motors", 1)
    rig.run(1.0)
    assert rig.spin(9, (1.0, 0.0, 0.0)) == pytest.approx(
        constants().of("motor_speed", 22), rel=0.01
    )


def test_hinges_out_of_line_hold_each_other(calm: Engine) -> None:
    """Two steering hinges side by side have parallel axes 2 m apart: the beam cannot swing."""
    rows = [(s.type, s.parent, s.face_id) for s in doors()]
    rows[3], rows[4] = (28, 0, 4), (28, 2, 3)
    rig = Rig(calm, machine(*rows), wind=(0.0, 0.0, 12.0))
    rig.run(2.0)
    assert abs(rig.angle(5, (0.0, 0.0, 1.0))) < 0.02
    assert rig.moved(5) == pytest.approx([0, 0, 0], abs=0.02)


def test_everything_that_acts_repeats_bit_by_bit(make_engine: MakeEngine) -> None:
    """Grip, cogs, winch, blades, thrust, a loop and a split, twice from the start."""
    foot = (ROOT, (35, 0, 0), (35, 0, 1), (35, 0, 2), (35, 0, 3), (63, 0, 4))
    rows: tuple[Row, ...] = (*foot, (POWERED, 5, 9), (14, 5, 3), (22, 5, 0), (26, 8, 1), (26, 8, 2))
    rows += ((5, 3, 0), (63, 11, 0), (27, 12, 0), (36, 13, 0), (45, 5, 6, 12, 4))
    tree = machine(*rows)
    geometry = place(tree)
    assert not geometry.overlaps
    seen = []
    for _ in range(2):
        engine = make_engine()
        assembly = assemble(tree, geometry, constants())
        world = engine.build(assembly, Scene(wind=(1.0, 0.0, -3.0)), RATE)
        for step in range(240):
            if step == 60:
                for entry in ("motors", "winches"):
                    world.switch(entry, 1)
            if step == 150:
                world.split([7])
            if step == 200:
                world.switch("grabbers", 0)
            world.step()
        seen.append(world.state())
    first, second = (vars(state) for state in seen)
    for name, value in first.items():
        assert value.tobytes() == second[name].tobytes()
    assert np.isfinite(first["position"]).all()


CARRIAGE = 0.01
"""kg."""


def held_by_a_slider(engine: Engine, kind: JointKind, axis: Vec3, slides: Vec3, at: Vec3) -> Array:
    """Load (6,) of a slider that keeps 2 kg at `at` from moving as a joint at 3 m would let it.

    A carriage of hardly any weight, which slides on it across, lets it close a loop.
    """
    centres = ((0.0, 0.25, 0.0), at, (0.0, 3.0, 0.0))
    slab = (Shape("box", (2.0, 0.5, 2.0)),)
    parts = (
        Part(0, centres[0], 1e4, (1e3, 1e3, 1e3), slab),
        Part(1, centres[1], 2.0, (0.2, 0.2, 0.2)),
        Part(2, centres[2], CARRIAGE, (0.01, 0.01, 0.01)),
    )
    across = (-slides[2], 0.0, slides[0]) if any(slides[::2]) else (0.0, 0.0, 1.0)
    joints = (
        Joint(1, 0, 0, 1, kind, (0.0, 3.0, 0.0), axis),
        Joint(2, 1, 1, 2, "prismatic", (0.0, 3.0, 0.0), across),
        Joint(2, 0, 0, 2, "prismatic", (0.0, 3.0, 0.0), slides),
    )
    blocks = ((0,), (1,), (2,))
    assembly = Assembly(parts, joints, blocks, centres, centres, (IDENTITY,) * 3)
    world = engine.build(assembly, Scene(), RATE)
    for _ in range(200):
        world.step()
    loads = world.reactions.copy()
    for loop in load_loops(joints, skeleton(len(parts), joints)):
        loads[loop.joints] = loop.share(loads)
    return loads[2]


UP, WEIGHT = (0.0, 1.0, 0.0), 2 * 32.81


@pytest.mark.parametrize("slides", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, 0.8)])
def test_a_slider_in_a_loop_tells_what_it_bears_across(engine: Engine, slides: Vec3) -> None:
    load = held_by_a_slider(engine, "prismatic", UP, slides, (0.0, 3.0, 0.0))
    assert load[1] == pytest.approx(WEIGHT + CARRIAGE * 32.81, rel=1e-3)
    assert np.abs(load[[0, 2, 3, 4, 5]]).max() < 0.01 * WEIGHT


@pytest.mark.parametrize(
    ("hinge", "slides", "at", "torque"),
    [
        ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (2.0, 3.0, 0.0), (0.0, 0.0, 2 * WEIGHT)),
        ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 3.0, 2.0), (-2 * WEIGHT, 0.0, 0.0)),
        ((1.0, 0.0, 0.0), UP, (0.0, 3.0, 2.0), (-2 * WEIGHT, 0.0, 0.0)),
    ],
)
def test_a_slider_in_a_loop_tells_the_torque_that_it_bears(
    engine: Engine, hinge: Vec3, slides: Vec3, at: Vec3, torque: Vec3
) -> None:
    load = held_by_a_slider(engine, "revolute", hinge, slides, at)
    assert load[3:] == pytest.approx(torque, abs=0.01 * WEIGHT)
    assert np.abs(load[:3]).max() < 0.5 * WEIGHT  # the hinge could bear all of the weight

"""What connections bear, against what is calculated by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import Engine, World
from agentflow.env.physics.loads import Loads
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.structure.load_sharing import load_loops
from agentflow.env.physics.structure.spanning_tree import skeleton
from agentflow.env.rollout import Array
from agentflow.env.scene import Scene
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine
from tests.env.conftest import MakeEngine
from tests.env.machines import machine

G = 32.81
FOOT = ((0, -1, -1), (35, 0, 0), (35, 0, 1), (35, 0, 2), (35, 0, 3))
"""A heavy cross to stand on; its root's top is free."""


def stand(
    engine: Engine, tree: Machine, entries: Sequence[str] = (), wind: float = 0.0
) -> tuple[World, Assembly]:
    """The machine after 1.5 s, some of its schedule switched on after 0.5 s; wind to x+, m/s."""
    assert not place(tree).overlaps
    assembly = assemble(tree, place(tree), constants())
    world = engine.build(assembly, Scene(wind=(wind, 0.0, 0.0)), 120.0)
    for step in range(180):
        for entry in entries if step == 60 else ():
            world.switch(entry, True)
        world.step()
    return world, assembly


def loads(world: World, assembly: Assembly) -> Mapping[tuple[int, int], Array]:
    """(6,) of each connection by its two blocks."""
    shared = world.reactions.copy()
    for loop in load_loops(assembly.joints, skeleton(len(assembly.parts), assembly.joints)):
        shared[loop.joints] = loop.share(shared)
    return {(j.block, j.partner): shared[i] for i, j in enumerate(assembly.joints)}


def force(load: Array) -> float:
    return float(np.linalg.norm(load[:3]))


def torque(load: Array) -> float:
    return float(np.linalg.norm(load[3:]))


def near(value: float) -> object:
    return pytest.approx(value, rel=0.01)


def test_a_tower_bears_its_ballast_and_the_lever(engine: Engine) -> None:
    """Three logs up, ballast on top and one at the side of the top."""
    tree = machine(*FOOT, (63, 0, 4), (63, 5, 0), (63, 6, 0), (35, 7, 0), (35, 7, 3))
    found = loads(*stand(engine, tree))
    for block, above in ((5, 9.0), (6, 8.0), (7, 7.0)):
        load = found[block, tree[block].parent]
        assert force(load) == near(above * G)
        assert torque(load) == near(3 * G * 1.0)
    assert force(found[8, 7]) == near(3 * G)
    assert torque(found[9, 7]) == near(3 * G * 0.5)


def test_a_spun_up_arm_bears_the_centripetal_force(engine: Engine) -> None:
    """Two logs, left and right on a rotating block that faces up, its speed held by its motor."""
    tree = machine(*FOOT, (22, 0, 4), (63, 5, 1), (63, 5, 2))
    world, assembly = stand(engine, tree, ["motors"])
    found = loads(world, assembly)
    spin = float(np.linalg.norm(world.state().angular_velocity[6]))
    assert spin == near(constants().of("motor_speed", 22))
    drag = library()[63].linear_drag * spin * 2.0
    for arm in (6, 7):
        assert force(found[arm, 5]) == near(float(np.linalg.norm([spin**2 * 2.0, G, drag])))
        assert torque(found[arm, 5]) == near(G * 1.5)


def test_a_chain_bears_what_hangs_below(engine: Engine) -> None:
    """Four ball joints with a small block each, down from a beam that sticks out."""
    beam = (*FOOT, (63, 0, 4), (63, 5, 0), (63, 6, 0), (35, 7, 1), (15, 7, 6), (15, 9, 0))
    rows = list(beam)
    for _ in range(3):
        rows += [(44, len(rows) - 1, 4 if len(rows) == len(beam) else 0), (15, len(rows), 0)]
    found = loads(*stand(engine, machine(*rows)))
    for link in range(3):
        ball = len(beam) + 2 * link
        load = found[ball, ball - 1]
        assert force(load) == near((3 - link) * 0.8 * G)
        assert torque(load) < 0.01 * G
        assert force(found[ball + 1, ball]) == near(((3 - link) * 0.8 - 0.5) * G)


def test_a_spring_adds_its_pull(engine: Engine) -> None:
    """A spring from the middle of an arm down to the foot of its post."""
    rows = (*FOOT, (63, 0, 4), (63, 5, 0), (63, 6, 6))
    spring = machine(*rows, (9, 5, 5, 7, 5))
    value = constants()
    found = loads(*stand(engine, spring, ["springs"]))
    geometry = place(spring)
    at, to = np.array(geometry.blocks[8].end_b), np.array(geometry.blocks[8].end_a)
    assert np.linalg.norm(to - at) > value["spring_length"] + value["spring_ramp"]
    pull = value.of("spring_force", 9) * (to - at) / np.linalg.norm(to - at)
    end = np.array([0.0, -0.2 * G, 0.0])
    weight = np.array([0.0, -1.0 * G, 0.0])
    pivot = np.array(geometry.blocks[7].origin)
    middle = np.array(geometry.blocks[7].center)
    assert force(found[7, 6]) == near(float(np.linalg.norm(pull + end + weight)))
    moment = np.cross(at - pivot, pull + end) + np.cross(middle - pivot, weight)
    assert torque(found[7, 6]) == near(float(np.linalg.norm(moment)))


def test_a_tower_bears_the_wind_on_it(engine: Engine) -> None:
    """Two logs up in a wind of 6 m/s: 0.6 * 3 m2 * 36 m2/s2 on each."""
    tree = machine(*FOOT, (63, 0, 4), (63, 5, 0))
    found = loads(*stand(engine, tree, wind=6.0))
    push = 0.6 * 3.0 * 36.0
    assert force(found[6, 5]) == near(float(np.hypot(push, G)))
    assert torque(found[6, 5]) == near(push * 1.5)
    assert force(found[5, 0]) == near(float(np.hypot(2 * push, 2 * G)))
    assert torque(found[5, 0]) == near(push * (1.5 + 4.5))


SWING = (
    *FOOT,
    (63, 0, 4),
    (63, 5, 0),
    (15, 6, 0),
    (35, 7, 1),
    (15, 7, 2),
    (15, 9, 0),
    (15, 10, 1),
    (15, 10, 2),
    (5, 11, 4),
    (5, 12, 4),
    (15, 13, 0),
    (15, 14, 0),
    (5, 15, 0),
    (5, 16, 0),
    (35, 17, 0),
    (35, 18, 0),
    (35, 19, 4),
)
"""A seat on four hinges under a beam; an auto-connection closes the parallelogram."""


def test_both_sides_of_a_swing_bear_half(engine: Engine) -> None:
    tree = machine(*SWING)
    links = place(tree).auto_connections
    assert [(link.block, link.partner) for link in links] == [(21, 20)]
    world, assembly = stand(engine, tree)
    plan = skeleton(len(assembly.parts), assembly.joints)
    assert len(plan.loops) == 1
    found = loads(world, assembly)
    for hinge, beam in ((13, 11), (14, 12)):
        assert force(found[hinge, beam]) == near(5.8 * G)
        assert force(found[hinge + 2, hinge]) == near(5.3 * G)
        assert force(found[hinge + 4, hinge + 2]) == near(5.0 * G)


@pytest.mark.parametrize("cut", [(), (5, 0), (8, 6)])
def test_every_part_of_a_braced_machine_is_in_balance(engine: Engine, cut: tuple[int, ...]) -> None:
    """What connections bear together holds every part's weight, whoever shares with whom, also
    where braces hold what broke."""
    tower = (*FOOT, (63, 0, 4), (63, 5, 0), (35, 6, 3), (63, 6, 5))
    tree = machine(*tower, (7, 1, 3, 6, 2), (7, 5, 1, 8, 0), (7, 3, 3, 6, 9), (7, 4, 3, 8, 7))
    world, assembly = stand(engine, tree)
    gone = {i for i, j in enumerate(assembly.joints) if (j.block, j.partner) == cut}
    world.split(sorted(gone))
    for _ in range(120):
        world.step()
    shared = world.reactions.copy()
    plan = skeleton(len(assembly.parts), assembly.joints, gone)
    assert len(plan.redundant) == 4 - len(gone)
    for loop in load_loops(assembly.joints, plan):
        shared[loop.joints] = loop.share(shared)
    for i, part in enumerate(assembly.parts):
        if part.block < 5:  # stands on the ground
            continue
        push, turn = np.zeros(3), np.zeros(3)
        for joint, load in zip(assembly.joints, shared, strict=True):
            sign = (joint.b == i) - (joint.a == i)
            arm = np.subtract(joint.pivot, part.centre)
            push += sign * load[:3]
            turn += sign * (load[3:] + np.cross(arm, load[:3]))
        assert push.tolist() == pytest.approx([0.0, part.mass * G, 0.0], abs=0.01 * G)
        assert turn.tolist() == pytest.approx([0.0, 0.0, 0.0], abs=0.01 * G)


Joint = tuple[tuple[float, float], tuple[float, float], slice, slice]
"""Of a plane frame: place, greatest force and torque, and the rows of the two parts' movements."""
WOOD, METAL = (15000.0, 5000.0), (25000.0, 8000.0)
ARM, BRACE, POST = slice(0, 3), slice(3, 6), slice(0, 0)


def plane_frame(
    joints: Mapping[tuple[int, int], Joint], weights: Sequence[tuple[slice, float, float]]
) -> dict[tuple[int, int], tuple[float, float]]:
    """Force and torque of each joint, by the displacement method: arm and brace may each shift and
    turn in their plane; `weights` are of which of them, kg, at which x."""
    stiffness = np.zeros((6, 6))
    moves = {}
    for pair, ((x, y), (strong, twist), one, other) in joints.items():
        parting = np.zeros((3, 6))
        shift = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
        parting[:, one] = shift
        parting[:, other] -= shift[:, : other.stop - other.start]
        hard = np.diag([strong**2, strong**2, twist**2])
        moves[pair] = hard @ parting
        stiffness += parting.T @ hard @ parting
    pushes = np.zeros(6)
    for which, mass, x in weights:
        pushes[which] += (0.0, mass * G, x * mass * G)
    shifts = np.linalg.solve(stiffness, pushes)
    found = {}
    for pair, law in moves.items():
        fx, fy, turn = law @ shifts
        found[pair] = float(np.hypot(fx, fy)), abs(float(turn))
    return found


KNEE = (*FOOT, (63, 0, 4), (63, 5, 0), (63, 6, 6), (35, 7, 0), (7, 6, 4, 7, 11))
"""A post, an arm to the right with ballast at its end, a brace below the arm."""


def test_a_braced_arm_bears_what_the_plane_frame_says(engine: Engine) -> None:
    found = loads(*stand(engine, machine(*KNEE)))
    joints = {
        (7, 6): ((0.5, 6.0), WOOD, ARM, POST),
        (9, 6): ((0.5, 4.0), METAL, BRACE, POST),
        (9, 7): ((2.0, 5.5), METAL, BRACE, ARM),
    }
    weights = [(ARM, 1.0, 2.0), (ARM, 3.0, 4.0), (BRACE, 0.25, 0.5), (BRACE, 0.25, 2.0)]
    for pair, (push, turn) in plane_frame(joints, weights).items():
        assert force(found[pair]) == near(push)
        assert torque(found[pair]) == near(turn)


RING = (
    *FOOT,
    (15, 0, 4),
    (15, 5, 0),
    (63, 6, 1),
    (63, 6, 2),
    (41, 7, 9),
    (41, 8, 9),
    (1, 9, 4),
    (15, 11, 0),
    (1, 10, 2),
)
"""A frame on a post, the same left and right, closed at the top right by an auto-connection."""


def test_a_closed_frame_bears_alike_on_both_sides(engine: Engine) -> None:
    """The tree hangs the top's middle on the left; the upper right corner closes the loop."""
    tree = machine(*RING)
    links = [(link.block, link.partner) for link in place(tree).auto_connections]
    assert links == [(12, 13)]
    found = loads(*stand(engine, tree))
    sides = [((7, 6), (8, 6)), ((9, 7), (10, 8)), ((11, 9), (13, 10)), ((12, 11), (12, 13))]
    above = [1.0 + 0.5 + 0.5 + 0.15, 0.5 + 0.5 + 0.15, 0.5 + 0.15, 0.15]
    for (left, right), mass in zip(sides, above, strict=True):
        assert force(found[left]) == near(force(found[right]))
        assert torque(found[left]) == near(torque(found[right]))
        assert abs(found[left][1]) == near(mass * G)


def settle(
    engine: Engine, tree: Machine, cut: Sequence[tuple[int, int]] = ()
) -> tuple[Mapping[tuple[int, int], float], list[tuple[int, int]]]:
    """Load over strength of each connection at rest, and what broke; `cut` does not hold."""
    assembly = assemble(tree, place(tree), constants())
    pairs = [(joint.block, joint.partner) for joint in assembly.joints]
    world = engine.build(assembly, Scene(), 120.0)
    sensed = Loads(assembly.joints, 0.02, 1.0 / 120)
    loose = [i for i, pair in enumerate(pairs) if pair in cut]
    sensed.release(loose)
    broken = []
    for _ in range(120):
        world.split(loose)
        world.step()
        loose = list(sensed.update(world.reactions))
        broken += [pairs[i] for i in loose]
    shares = sensed.utilisation().tolist()
    return {pairs[i]: share for i, share in zip(sensed.connections, shares, strict=True)}, broken


@pytest.mark.slow
def test_braces_and_closed_frames_are_stronger_than_the_same_without(
    engine: Engine,
) -> None:
    arm = machine(*KNEE[:-1])
    bare, _ = settle(engine, arm)
    braced, _ = settle(engine, machine(*KNEE))
    assert bare[7, 6] > 5.0 * max(braced[7, 6], braced[9, 6], braced[9, 7])
    tower, _ = settle(engine, machine(*KNEE[:-1], (7, 4, 3, 6, 6)))
    assert bare[5, 0] > 3.0 * max(tower[5, 0], tower[6, 5], tower[9, 4], tower[9, 6])
    ring = machine(*RING, (35, 12, 3))
    closed, _ = settle(engine, ring)
    opened, _ = settle(engine, ring, [(12, 13)])
    corners = [(7, 6), (8, 6), (9, 7), (10, 8), (11, 9), (13, 10)]
    assert max(opened[pair] for pair in corners) > 3.0 * max(closed[pair] for pair in corners)


@pytest.mark.slow
def test_under_more_weight_the_same_without_breaks(make_engine: MakeEngine) -> None:
    """At 15 times the weight, the arm without its brace and the frame that is not closed break."""
    heavy = make_engine(constants().changed({"gravity": 15 * G}))
    stay = (7, 4, 3, 6, 6)
    arm, ring = machine(*KNEE[:-1], stay), machine(*RING, (35, 12, 3))
    assert settle(heavy, arm)[1] == [(7, 6)]
    assert settle(heavy, machine(*KNEE, stay))[1] == []
    assert settle(heavy, ring, [(12, 13)])[1][0] == (9, 7)
    assert settle(heavy, ring)[1] == []

"""How connections share load: against another method, and against a case solved by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.env.physics.model import Joint, Strength
from agentflow.env.physics.structure.load_sharing import load_loops, product, solve
from agentflow.env.physics.structure.spanning_tree import skeleton
from agentflow.env.rollout import Array

WOOD, METAL = Strength(15000.0, 5000.0), Strength(25000.0, 8000.0)


def shared(count: int, joints: list[Joint], reactions: Array) -> Array:
    found = reactions.copy()
    for loop in load_loops(joints, skeleton(count, joints)):
        found[loop.joints] = loop.share(found)
    return found


def by_displacements(count: int, joints: list[Joint], reactions: Array) -> Array:
    """The same by the other method: the stiffness matrix of all parts, solved for their moves."""
    stiffness, pushes = np.zeros((6 * count, 6 * count)), np.zeros(6 * count)
    elements = []
    for joint, reaction in zip(joints, reactions, strict=True):
        x, y, z = joint.pivot
        move = np.eye(6)
        move[3:, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
        element = np.zeros((6 * count, 6))
        element[6 * joint.b : 6 * joint.b + 6] += move
        element[6 * joint.a : 6 * joint.a + 6] -= move
        assert joint.strength is not None
        hard = np.repeat([joint.strength.force**2, joint.strength.torque**2], 3)
        stiffness += element @ np.diag(hard) @ element.T
        pushes += element @ reaction
        elements.append((element, hard))
    moves = np.linalg.lstsq(stiffness, pushes, rcond=1e-12)[0]
    return np.array([hard * (element.T @ moves) for element, hard in elements])


frames = st.integers(2, 7).flatmap(
    lambda n: st.tuples(
        st.just(n),
        st.lists(
            st.tuples(
                st.integers(0, n - 1),
                st.integers(1, n - 1),
                st.tuples(*[st.integers(-6, 6)] * 3),
                st.sampled_from([WOOD, METAL]),
            ),
            min_size=1,
            max_size=12,
        ),
        st.integers(0, 2**32 - 1),
    )
)


@given(frames)
def test_two_methods_agree(
    frame: tuple[int, list[tuple[int, int, tuple[int, int, int], Strength]], int],
) -> None:
    count, edges, seed = frame
    joints = [
        Joint(0, 0, a, (a + step) % count, pivot=(x / 2, y / 2, z / 2), strength=strength)
        for a, step, (x, y, z), strength in edges
    ]
    plan = skeleton(count, joints)
    reactions = np.random.default_rng(seed).normal(size=(len(joints), 6)) * 1000.0
    reactions[list(plan.redundant)] = 0.0
    found = shared(count, joints, reactions)
    assert found == pytest.approx(by_displacements(count, joints, reactions), abs=1e-6)


def test_two_connections_side_by_side_share_by_the_lever() -> None:
    """Two posts d apart carry a weight e off the middle: W/2 +- W e d / (d^2 + 4 c^2), and a
    torque of W e c^2 / (d^2 / 2 + 2 c^2) each, with c = 1/3 m the ratio of the strengths."""
    weight, d, e, c2 = 900.0, 2.0, 0.7, 1.0 / 9.0
    joints = [Joint(1, 0, 0, 1, pivot=(x, 0.0, 0.0), strength=WOOD) for x in (-d / 2, d / 2)]
    alone = np.zeros((2, 6))
    alone[0] = [0.0, weight, 0.0, 0.0, 0.0, weight * (d / 2 + e)]
    left, right = shared(2, joints, alone)
    lever = weight * e * d / (d * d + 4 * c2)
    turn = weight * e * c2 / (d * d / 2 + 2 * c2)
    assert left == pytest.approx([0, weight / 2 - lever, 0, 0, 0, turn])
    assert right == pytest.approx([0, weight / 2 + lever, 0, 0, 0, turn])


def test_a_locked_hinge_shares_all_but_its_turn() -> None:
    joints = [
        Joint(1, 0, 0, 1, pivot=(0.0, 0.0, 0.0), strength=WOOD),
        Joint(1, 0, 0, 1, "revolute", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), WOOD),
    ]
    alone = np.array([[10.0, 20.0, 30.0, 40.0, 50.0, 60.0], [0.0] * 6])
    fixed, hinge = shared(2, joints, alone)
    assert hinge == pytest.approx([5.0, 10.0, 15.0, 20.0, 25.0, 0.0])
    assert fixed == pytest.approx([5.0, 10.0, 15.0, 20.0, 25.0, 60.0])


def test_loops_that_have_nothing_in_common_are_shared_apart() -> None:
    edges = [(0, 1), (1, 2), (2, 3), (3, 4), (0, 2), (2, 4)]
    joints = [Joint(b, a, a, b, pivot=(a, b, 0.0), strength=WOOD) for a, b in edges]
    found = load_loops(joints, skeleton(5, joints))
    assert [loop.joints.tolist() for loop in found] == [[0, 1, 4], [2, 3, 5]]
    tree = joints[:4]
    assert load_loops(tree, skeleton(5, tree)) == ()


def test_arithmetic_in_order_is_arithmetic() -> None:
    random = np.random.default_rng(1)
    a, b = random.normal(size=(5, 4)), random.normal(size=(4, 3))
    assert product(a, b) == pytest.approx(a @ b)
    system = a @ a.T + np.eye(5)
    right = random.normal(size=(5, 3))
    assert solve(system, right) == pytest.approx(np.linalg.solve(system, right))

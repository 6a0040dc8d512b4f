"""Spanning trees."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.env.physics.model import Joint, JointKind
from agentflow.env.physics.structure.spanning_tree import Link, Parallel, Piece, skeleton
from agentflow.machine.geometry.vectors import Vec3


def fixed(a: int, b: int) -> Joint:
    return Joint(b, a, a, b)


def hinge(a: int, b: int) -> Joint:
    return Joint(b, a, a, b, kind="revolute")


def test_a_chain_is_one_body() -> None:
    plan = skeleton(3, [fixed(0, 1), hinge(1, 2)])
    assert plan.pieces == (Piece(0, (Link(1, 0, 0, False), Link(2, 1, 1, False))),)
    assert plan.cluster == (0, 0, 2)


def test_a_broken_joint_parts_the_body() -> None:
    plan = skeleton(3, [fixed(0, 1), fixed(1, 2)], broken={0})
    assert plan.pieces == (Piece(0, ()), Piece(1, (Link(2, 1, 1, False),)))


def test_a_closing_joint_takes_over_and_turns_the_rest_round() -> None:
    joints = [fixed(0, 1), hinge(1, 2), fixed(2, 3), fixed(0, 3)]
    assert skeleton(4, joints).locked == (1,)
    plan = skeleton(4, joints, broken={0})
    assert plan.pieces == (
        Piece(0, (Link(3, 0, 3, False), Link(2, 3, 2, True), Link(1, 2, 1, True))),
    )


def test_rigid_bridges_lock_a_moving_joint() -> None:
    plan = skeleton(3, [hinge(0, 1), fixed(1, 2), fixed(0, 2)])
    assert plan.locked == (0,)
    assert plan.cluster == (0, 0, 0)


def test_a_second_way_through_moving_joints_is_a_loop() -> None:
    plan = skeleton(3, [hinge(0, 1), hinge(1, 2), hinge(0, 2)])
    assert plan.loops == (Link(2, 0, 2, False),)
    assert plan.locked == ()


def test_a_second_rigid_way_is_idle() -> None:
    assert skeleton(2, [fixed(0, 1), fixed(0, 1)]).redundant == (1,)


graphs = st.integers(1, 12).flatmap(
    lambda n: st.tuples(
        st.just(n),
        st.lists(
            st.tuples(st.integers(0, n - 1), st.integers(0, n - 1), st.booleans()), max_size=25
        ),
        st.sets(st.integers(0, 24)),
    )
)


@given(graphs)
def test_every_part_is_in_one_body_and_every_joint_has_one_role(
    graph: tuple[int, list[tuple[int, int, bool]], set[int]],
) -> None:
    count, edges, broken = graph
    joints = [hinge(a, b) if moving else fixed(a, b) for a, b, moving in edges]
    plan = skeleton(count, joints, broken)
    parts = [b.root for b in plan.pieces] + [k.part for b in plan.pieces for k in b.links]
    assert sorted(parts) == list(range(count))
    used = [link.joint for body in plan.pieces for link in body.links]
    closing = [loop.joint for loop in plan.loops] + [other.joint for other in plan.parallel]
    rigid = {link.joint for link in plan.links if link.rigid}
    assert rigid <= set(plan.jammed)
    held = [*plan.locked, *(set(plan.jammed) - rigid)]
    roles = sorted([*used, *held, *closing, *plan.redundant])
    assert roles == [i for i in range(len(joints)) if i not in broken]
    for body in plan.pieces:
        seen = {body.root}
        for link in body.links:
            assert link.parent in seen
            seen.add(link.part)
        assert body.root == min(seen)


def moving(kind: JointKind, *pivot: float, axis: Vec3 = (0.0, 0.0, 1.0), a: int = 0) -> Joint:
    return Joint(1, 0, a, 1 - a, kind, pivot, axis)  # type: ignore[arg-type]


HINGE = moving("revolute", 0.0, 0.0, 0.0)
BALL = moving("spherical", 0.0, 0.0, 2.0)
SLIDE = moving("prismatic", 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("joints", "lead", "parallel"),
    [
        ([HINGE, moving("revolute", 0.0, 0.0, 3.0)], 0, {1: 1.0}),
        ([HINGE, moving("revolute", 0.0, 0.0, 3.0, axis=(0.0, 0.0, -1.0))], 0, {1: -1.0}),
        ([HINGE, moving("revolute", 0.0, 0.0, 3.0, a=1)], 0, {1: -1.0}),
        ([BALL, HINGE], 1, {0: 1.0}),
        ([BALL, BALL, HINGE], 2, {0: 1.0, 1: 1.0}),
        ([BALL, BALL], 0, {1: 1.0}),
        ([SLIDE, moving("prismatic", 5.0, 1.0, 0.0)], 0, {1: 1.0}),
    ],
)
def test_joints_that_allow_the_same_motion_are_parallel(
    joints: list[Joint], lead: int, parallel: dict[int, float]
) -> None:
    plan = skeleton(2, joints)
    (link,) = plan.links
    assert (link.joint, link.rigid, plan.loops) == (lead, False, ())
    assert {other.joint: other.sign for other in link.parallel} == parallel


@pytest.mark.parametrize(
    "other",
    [
        moving("revolute", 1.0, 0.0, 0.0),
        moving("revolute", 0.0, 0.0, 0.0, axis=(0.0, 1.0, 0.0)),
        moving("spherical", 1.0, 0.0, 0.0),
        SLIDE,
    ],
)
def test_joints_with_no_common_motion_jam(other: Joint) -> None:
    plan = skeleton(3, [HINGE, other, fixed(1, 2)])
    assert plan.cluster == (0, 0, 0)
    assert (plan.jammed, plan.locked, plan.loops) == ((0, 1), (), ())
    assert [(link.joint, link.rigid) for link in plan.links] == [(0, True), (2, False)]
    assert skeleton(3, [HINGE, other, fixed(1, 2)], {1}).jammed == ()


def test_what_two_jammed_joints_unite_may_jam_others() -> None:
    """Parts 1 and 2 hang on two hinges out of line; each has a hinge in line with part 0's."""
    joints = [HINGE, replace(HINGE, b=2), hinge(1, 2), replace(hinge(1, 2), pivot=(1.0, 0.0, 0.0))]
    plan = skeleton(3, joints)
    assert plan.cluster == (0, 1, 1)
    assert [link.joint for link in plan.links] == [0, 2]
    assert list(plan.parallel) == [Parallel(1, 1.0)]


def test_two_balls_apart_leave_a_hinge_and_three_none() -> None:
    balls = [moving("spherical", x, y, 0.0) for x, y in ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0))]
    assert [loop.joint for loop in skeleton(2, balls).loops] == [1, 2]
    assert skeleton(2, [*balls, moving("spherical", 0.0, 1.0, 0.0)]).jammed == (0, 1, 2, 3)

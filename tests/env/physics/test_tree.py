"""Spanning trees."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from agentflow.env.physics.model import Joint
from agentflow.env.physics.spanning_tree import Link, Piece, skeleton


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
    assert plan.loops == (2,)
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
    roles = sorted([*used, *plan.locked, *plan.loops, *plan.redundant])
    assert roles == [i for i in range(len(joints)) if i not in broken]
    for body in plan.pieces:
        seen = {body.root}
        for link in body.links:
            assert link.parent in seen
            seen.add(link.part)
        assert body.root == min(seen)

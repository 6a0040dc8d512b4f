import pytest

from agentflow.machine import AutoConnection, library, place
from agentflow.machine.blocks.types import DIRECTIONS
from agentflow.machine.geometry.placement import overlap_of
from tests.loops import for_each
from tests.machine.builders import CAR, CATAPULT, Spec, build

S = 0.5**0.5
Vec = tuple[float, ...]
ROOT_FACE = {"z+": 0, "z-": 1, "x-": 2, "x+": 3, "y+": 4, "y-": 5}
AXES = {
    "z+": ("x+", "y+", (0, 0, 0, 1)),
    "z-": ("x-", "y+", (0, 1, 0, 0)),
    "x+": ("z-", "y+", (0, S, 0, S)),
    "x-": ("z+", "y+", (0, -S, 0, S)),
    "y+": ("x+", "z-", (-S, 0, 0, S)),
    "y-": ("x+", "z+", (S, 0, 0, S)),
}
"""Right, up, quaternion by facing."""


def axis(name: str) -> Vec:
    return tuple((1.0 if name[1] == "+" else -1.0) if name[0] == own else 0.0 for own in "xyz")


def plus(*vectors: Vec) -> Vec:
    return tuple(sum(parts) for parts in zip(*vectors, strict=True))


def times(factor: float, vector: Vec) -> Vec:
    return tuple(factor * part for part in vector)


def rotated(quaternion: Vec, vector: Vec) -> Vec:
    x, y, z, w = quaternion
    u, v = (x, y, z), vector

    def cross(a: Vec, b: Vec) -> Vec:
        return (
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        )

    return plus(v, times(2, cross(u, plus(cross(u, v), times(w, v)))))


@pytest.mark.parametrize("facing", AXES)
def test_the_six_orientations(facing: str) -> None:
    right, up, quaternion = AXES[facing]
    placed = place(build((1, 0, ROOT_FACE[facing])))[1]
    assert placed.facing == facing
    assert (placed.right, placed.up, placed.front) == (axis(right), axis(up), axis(facing))
    assert placed.quaternion == quaternion
    for own, turned in (((1, 0, 0), right), ((0, 1, 0), up), ((0, 0, 1), facing)):
        assert rotated(quaternion, own) == pytest.approx(axis(turned))


@for_each((kind, facing) for kind in library() if kind and library()[kind].size for facing in AXES)
def test_every_type_on_every_facing(kind: int, facing: str) -> None:
    right, up = axis(AXES[facing][0]), axis(AXES[facing][1])
    front = axis(facing)
    block = library()[kind]
    assert block.size is not None
    sx, sy, sz = block.size
    placed = place(build((kind, 0, ROOT_FACE[facing])))[1]
    origin = times(0.5, front)
    assert placed.origin == origin
    assert placed.center == pytest.approx(plus(origin, times(sz / 2, front)))
    extent = [abs(sx * right[i]) + abs(sy * up[i]) + abs(sz * front[i]) for i in range(3)]
    assert [b - a for a, b in zip(placed.box_min, placed.box_max, strict=True)] == pytest.approx(
        extent
    )
    for own, face in zip(block.faces, placed.faces, strict=True):
        x, y, z = own.position
        assert face.position == pytest.approx(
            plus(origin, times(x, right), times(y, up), times(z, front))
        )
        dx, dy, dz = DIRECTIONS[own.direction]
        assert axis(face.facing) == plus(times(dx, right), times(dy, up), times(dz, front))


def test_the_root_is_centred_on_its_origin() -> None:
    root = place(build())[0]
    assert (root.box_min, root.box_max) == ((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    assert (root.origin, root.center, root.facing) == ((0, 0, 0), (0, 0, 0), "z+")


def test_roll_follows_the_facing_and_not_the_parents_roll() -> None:
    straight = place(build((1, 0, 4)))[1]
    # up from the root, left from there (x-), then up again from its Up face (y+)
    bent = place(build((15, 0, 4), (15, 1, 1), (1, 2, 3)))[3]
    assert (bent.facing, bent.right, bent.up) == (straight.facing, straight.right, straight.up)


def test_a_face_inside_a_container_looks_to_its_front() -> None:
    geometry = place(build((30, 0, 4), (36, 1, 0)))
    assert (geometry[1].box_min, geometry[1].box_max) == ((-1.2, 0.5, -1.5), (1.2, 3.3, 1.5))
    assert geometry[1].faces[0].position == (0.0, 1.5, 0.0)
    assert (geometry[2].origin, geometry[2].facing) == ((0.0, 1.5, 0.0), "y+")
    assert geometry[2].center == (0.0, 2.45, 0.0)


def test_the_rim_faces_of_a_large_wheel() -> None:
    faces = place(build((46, 0, 3)))[1].faces
    assert [(face.position, face.facing) for face in faces] == [
        ((1.5, 0.0, 0.0), "x+"),
        ((1.5, 0.0, 1.5), "x+"),
        ((1.5, 0.0, -1.5), "x+"),
        ((1.5, 1.5, 0.0), "x+"),
        ((1.5, -1.5, 0.0), "x+"),
        ((1.0, 0.0, 1.5), "z+"),
        ((1.0, 0.0, -1.5), "z-"),
        ((1.0, 1.5, 0.0), "y+"),
        ((1.0, -1.5, 0.0), "y-"),
    ]


def test_two_ended_blocks_have_ends_and_neither_box_nor_face() -> None:
    geometry = place(build((1, 0, 4), (9, 0, 0, 1, 0), (15, 1, 0), (1, 0, 0)))
    spring = geometry[2]
    assert (spring.end_a, spring.end_b) == ((0.0, 0.0, 0.5), (0.0, 2.5, 0.0))
    assert (spring.two_ended, spring.faces) == (True, ())
    assert spring.center == (0.0, 1.25, 0.25)
    assert spring.to_json() == {
        "id": 2,
        "type": 9,
        "end_a": [0.0, 0.0, 0.5],
        "end_b": [0.0, 2.5, 0.0],
    }
    assert geometry.overlaps == ()
    assert geometry.size == (1.0, 4.0, 3.0)
    assert geometry[0].end_a is None
    assert geometry.children(1) == (3,)
    assert geometry.free_faces(0) == (1, 2, 3, 5)


def test_json_of_a_placed_block() -> None:
    assert place(build((2, 0, 2)))[1].to_json() == {
        "id": 1,
        "type": 2,
        "position": [-0.5, 0.0, 0.0],
        "center": [-0.75, 0.0, 0.0],
        "orientation": "x-",
        "quaternion": [0.0, -S, 0.0, S],
        "box_min": [-1.0, -1.0, -1.0],
        "box_max": [-0.5, 1.0, 1.0],
        "faces": [{"face_id": 0, "position": [-1.0, 0.0, 0.0], "facing": "x-"}],
    }


# Overlaps


def test_touching_boxes_do_not_overlap() -> None:
    # four blocks around a corner; the last touches the side of the root
    machine = build((15, 0, 0), (15, 1, 2), (15, 2, 2))
    geometry = place(machine)
    assert geometry[3].box_max == (1.5, 0.5, 0.5)
    assert geometry.overlaps == ()
    assert overlap_of(geometry[0], geometry[3]) == (0.0, 1.0, 1.0)


def test_the_smallest_overlap_counts() -> None:
    # a pad 0.8 wide beside a boulder 1.9 wide on the next face of a log: they overlap by 0.35 m
    machine = build((63, 0, 0), (49, 1, 7), (36, 1, 8))
    assert place(machine).overlaps == ((2, 3),)
    assert overlap_of(place(machine)[2], place(machine)[3]) == (0.8, 0.5, 0.35)


def test_a_container_may_overlap_its_child_and_nothing_else() -> None:
    # the boulder sits in the container; a block on a block in it does not belong to it
    assert place(build((30, 0, 4), (36, 1, 0))).overlaps == ()
    assert place(build((30, 0, 4), (15, 1, 0), (15, 2, 0))).overlaps == ((1, 3),)
    assert place(build((1, 0, 0), (30, 1, 3), (15, 1, 4))).overlaps == ((2, 3),)


# Closed loops

U = ((1, 0, 2), (1, 0, 3), (1, 1, 6), (1, 2, 6))
"""Two posts, 3 and 4, whose inner faces 3.4 and 4.2 face each other 3 m apart."""


@pytest.mark.parametrize(
    ("bridge", "loops"),
    [
        ([(63, 3, 4)], [(5, 0, 4, 2)]),
        ([(63, 4, 2)], [(5, 0, 3, 4)]),
        ([(1, 3, 4), (15, 4, 2)], [(5, 0, 6, 0)]),
        ([(1, 3, 4), (5, 4, 2)], [(5, 0, 6, 0)]),
        ([(5, 3, 4), (1, 4, 2)], [(6, 0, 5, 0)]),
        ([(15, 3, 4), (5, 5, 0), (22, 4, 2)], [(7, 0, 6, 0)]),
        ([(15, 3, 4), (5, 5, 0), (5, 4, 2)], []),
        ([(1, 3, 4)], []),
        ([(15, 3, 4), (9, 5, 0, 4, 2)], []),
    ],
)
def test_loops_close_where_a_rigid_or_powered_front_meets_a_face(
    bridge: list[Spec], loops: list[tuple[int, int, int, int]]
) -> None:
    assert place(build(*U, *bridge)).auto_connections == tuple(
        AutoConnection(*loop) for loop in loops
    )


def test_trees_without_loops_have_none() -> None:
    assert place(CATAPULT).auto_connections == ()
    assert place(CAR).auto_connections == ()

"""Roads: their centre lines, their walls, and what is told of them."""

from __future__ import annotations

from math import hypot, pi, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.env.scene import SceneObject
from agentflow.env.tasks.features.roads import (
    LEAP,
    Curve,
    Road,
    Segment,
    centre_line,
    road_walls,
)
from agentflow.env.tasks.registry import get_task

ROAD = Road(half_width=10)
CORNER = Curve(angle=90, at=40, inner_radius=5, back=90, further=60)
HALF_TURN = Curve(angle=180, at=15, inner_radius=9)
ARC = pi / 2 * 15
"""m, of a quarter of the centre line's circle."""


@pytest.mark.parametrize(
    ("curve", "along", "place"),
    [
        (CORNER, 40, (0, 40)),
        (CORNER, 40 + ARC, (15, 55)),
        (CORNER, 40 + ARC + 60, (75, 55)),
        (CORNER, 40 + 2 * ARC + 60, (90, 70)),
        (CORNER, 40 + 2 * ARC + 160, (90, 170)),
        (HALF_TURN, 15 + pi * 19 / 2, (19, 34)),
        (HALF_TURN, 15 + pi * 19, (38, 15)),
        (HALF_TURN, 15 + pi * 19 + 50, (38, -35)),
    ],
)
def test_places_on_the_line_are_as_far_along_as_they_lie(
    curve: Curve, along: float, place: tuple[float, float]
) -> None:
    line = centre_line(ROAD, curve)
    assert line.distance_along(*place, near=along) == pytest.approx(along)
    assert line.distance_along(*place, near=along - 10) == pytest.approx(along)


@given(
    st.floats(1, 150),
    st.floats(-9, 9),
    st.sampled_from([CORNER, HALF_TURN]),
)
def test_who_drives_beside_the_line_is_as_far_as_on_it(
    along: float, aside: float, curve: Curve
) -> None:
    line = centre_line(ROAD, curve)
    rest = along
    for segment in line.segments:
        if rest <= segment.length:
            break
        rest -= segment.length
    x, z, _ = segment.position_at(rest, aside)
    assert line.distance_along(x, z, near=along) == pytest.approx(along, abs=1e-6)


def test_a_straight_road_has_the_distance_along_z_to_the_last_bit() -> None:
    line = centre_line(Road(), Curve())
    assert line.distance_along(3.3, 45.123456789, near=0.0) == 45.123456789
    assert line.distance_along(-3.3, -7.1, near=0.0) == -7.1


def test_nobody_gains_by_leaping_over_to_the_way_back() -> None:
    line = centre_line(ROAD, HALF_TURN)
    here = 5.0
    for x in range(39):  # straight across, from one side of the half circle to the other
        here = line.distance_along(float(x), 5.0, near=here)
    assert here < 15.0 + LEAP


def test_a_left_turn_is_the_mirror_image_of_a_right_turn() -> None:
    right = Segment(0.0, 0.0, 0.0, 10.0, radians(60))
    left = Segment(0.0, 0.0, 0.0, 10.0, -radians(60))
    for along, aside in ((0.0, 0.0), (4.0, 2.0), (10.0, -3.0)):
        x, z, heading = right.position_at(along, aside)
        assert left.position_at(along, -aside) == pytest.approx((-x, z, -heading))
        assert right.distance_along(x, z) == pytest.approx(along)
        assert left.distance_along(-x, z) == pytest.approx(along)


@pytest.mark.parametrize("curve", [CORNER, HALF_TURN])
def test_walls_keep_their_distance_from_the_line_all_the_way(curve: Curve) -> None:
    walls = [item for item in road_walls(ROAD, curve) if item.name != "wall back"]
    line = centre_line(ROAD, curve)
    for segment in line.segments:
        for step in range(1, 20):
            for side in (-1, 1):
                x, z, _ = segment.position_at(segment.length * step / 20, side * 9.4)
                assert not any(_within(x, z, wall) for wall in walls)
                x, z, _ = segment.position_at(segment.length * step / 20, side * 10)
                assert any(_within(x, z, wall) for wall in walls)


def _within(x: float, z: float, wall: SceneObject) -> bool:
    """Whether a place is in a wall, seen from above."""
    _, s, _, c = wall.rotation
    sine, cosine = 2 * s * c, c * c - s * s
    dx, dz = x - wall.position[0], z - wall.position[2]
    across, ahead = dx * cosine - dz * sine, dx * sine + dz * cosine
    return abs(across) <= wall.size[0] / 2 and abs(ahead) <= wall.size[2] / 2


def told(curve: Curve) -> tuple[str, ...]:
    """What a brief says of a road with these turns."""
    knobs = {f"curve.{name}": value for name, value in curve.model_dump().items()}
    scene = get_task("movement", {"road.half_width": ROAD.half_width, **knobs}).brief.scene
    return tuple(sentence for sentence in scene[2:] if "road" in sentence or "straight" in sentence)


def test_a_road_that_turns_tells_where() -> None:
    assert told(CORNER)[1:] == (
        "At z = 40 m the road turns 90 degrees to the right (towards x+): its centre line follows "
        "a circle of radius 15 m about x = 15 m, z = 40 m, to x = 15 m, z = 55 m; the inner "
        "sides of the walls stay 19 m apart, in flat pieces that turn by 6 degrees each.",
        "After 60 m straight ahead it turns 90 degrees to the left on a circle of the same radius, "
        "to x = 90 m, z = 70 m.",
        "From there it continues straight towards z+.",
    )
    assert told(HALF_TURN)[-1] == "From there it continues straight towards z-."
    assert len(told(Curve())) == 1


def test_only_a_road_that_turns_allows_what_helps_to_steer() -> None:
    straight, turning = (set(get_task(name).brief.blocks) for name in ("movement", "movement/5"))
    assert turning - straight == {19, 40}


def test_no_wall_stands_where_machines_start() -> None:
    for name in ("movement/5", "delivery/5"):
        for item in get_task(name).scene().objects:
            if item.name.startswith("wall") and abs(item.position[2]) < 8.5:
                assert hypot(item.position[0]) >= 9.5

import pytest

from agentflow.machine import place
from agentflow.machine.geometry.balance import centre_of_mass, mass, stands, support_polygon
from tests.machine.builders import CAR, Spec, build

LEFT, RIGHT = (-1.0, -1.0), (1.0, -1.0)


def test_a_bare_root_stands_on_its_corners() -> None:
    geometry = place(build())
    assert mass(geometry) == 0.25
    assert centre_of_mass(geometry) == (0.0, 0.0, 0.0)
    assert support_polygon(geometry) == ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
    assert stands(geometry)


def test_centre_of_mass_is_weighted_by_mass() -> None:
    # root 0.25 kg at 0, ballast 3 kg at x = 1
    geometry = place(build((35, 0, 3)))
    assert mass(geometry) == 3.25
    assert centre_of_mass(geometry) == (pytest.approx(3 / 3.25), 0.0, 0.0)


def test_a_two_ended_block_weighs_half_at_each_end() -> None:
    # spring 0.4 kg from (0, 0, 0.5) to (0, 0.5, 0)
    geometry = place(build((9, 0, 0, 0, 4)))
    assert mass(geometry) == pytest.approx(0.65)
    x, y, z = centre_of_mass(geometry)
    assert (x, y, z) == (0.0, pytest.approx(0.1 / 0.65), pytest.approx(0.1 / 0.65))


def test_wheels_stand_on_lines_below_their_axes() -> None:
    assert support_polygon(place(CAR)) == ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
    assert stands(place(CAR))


@pytest.mark.parametrize(
    ("blocks", "polygon", "upright"),
    [
        # two wheels on one axle: a line under the centre of mass, and off it
        ([(2, 0, 2), (2, 0, 3)], ((-1.0, 0.0), (1.0, 0.0)), True),
        ([(2, 0, 2), (2, 0, 3), (15, 0, 0)], ((-1.0, 0.0), (1.0, 0.0)), False),
        # a wheel lying flat under the root
        ([(40, 0, 5)], ((-1.0, 0.0), (0.0, -1.0), (1.0, 0.0), (0.0, 1.0)), True),
        # on a boulder
        ([(36, 0, 5)], ((0.0, 0.0),), True),
        # a long arm to one side
        ([(15, 0, 5), (63, 0, 3)], ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)), False),
    ],
)
def test_support_polygon_and_stability(
    blocks: list[Spec], polygon: tuple[object, ...], upright: bool
) -> None:
    geometry = place(build(*blocks))
    assert support_polygon(geometry) == polygon
    assert stands(geometry) is upright

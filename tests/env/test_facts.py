"""The physics that prompts state, against the engine."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.engines import default_engine
from agentflow.env.scene import Scene
from agentflow.machine import library
from agentflow.prompts.render import facts
from benchmarks.facts import HIGH, MEASURED, Stand, friction, spring_pull, stated

LOOSE = {"bounce": 0.2, "thrust": 0.06}
"""Relative tolerance where single steps matter, or the weight of the car; 0.025 elsewhere."""
ON_MUJOCO = {"thrust": 0.13, "friction.wheel": 0.07, "grabber.reach": 0.25}
"""Prompts state what PyBullet does, which loads wheels unevenly: docs/explanation/validation.md."""
CONSTANTS = {
    ("suspension", "damping"): "suspension_damping",
    ("winch", "shortest"): "winch_shortest",
}
"""Facts that are constants of the engine and are not measured."""
PAGE = Path(__file__).parents[2] / "docs" / "results" / "accuracy.md"


def _paths(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, item in items:
            yield from _paths(item, (*path, key))
    else:
        yield path


@pytest.mark.parametrize("path", MEASURED, ids=lambda path: ".".join(map(str, path)))
def test_the_engine_agrees(path: tuple[str | int, ...]) -> None:
    tolerance = LOOSE.get(str(path[0]), 0.025)
    if default_engine().name == "mujoco":
        name = ".".join(map(str, path))
        tolerance = max([tolerance, *(v for k, v in ON_MUJOCO.items() if name.startswith(k))])
    assert MEASURED[path]() == pytest.approx(stated(path), rel=tolerance)


def test_every_fact_is_measured_or_a_constant() -> None:
    for path in set(_paths(facts())) - set(MEASURED):
        if path[0] != "strength":
            assert stated(path) == constants()[CONSTANTS[path]], path


def test_strengths_and_motors_are_those_of_the_engine() -> None:
    strength, value = facts()["strength"], constants()
    for kind in library():
        own = strength.get(kind, strength["usual"])
        assert own == [value.of("strength_force", kind), value.of("strength_torque", kind)]
        motor = facts()["motor"].get(kind, {"torque": 0.0, "speed": 0.0})
        assert motor["torque"] == value.of("motor_torque", kind)
        assert motor["speed"] == value.of("motor_speed", kind)


def test_the_documentation_shows_the_same_numbers() -> None:
    page = PAGE.read_text(encoding="utf-8")
    for path in MEASURED:
        assert f"| {'.'.join(map(str, path))} | {stated(path):g} |" in page


@pytest.mark.parametrize("face", range(6))
def test_wheels_turn_like_rotating_blocks_unless_they_face_to_the_left(face: int) -> None:
    spins = [Stand([(kind, 0, face)]).run(0.05, motors=1).turning(1) for kind in (2, 22)]
    left = face == 2
    assert (spins[0] * spins[1] > 0) == (not left)


@pytest.mark.parametrize("kind", [2, 13, 22, 28, 46])
def test_joints_turn_about_their_building_points(kind: int) -> None:
    stand = Stand([(kind, 0, 4)])
    before = stand.world.state()
    after = stand.run(0.3, motors=1, steering_hinges=1).world.state()
    assert after.position[1] == pytest.approx(before.position[1], abs=1e-3)
    assert abs(after.angular_velocity[1]).max() > 1.0
    swings = abs(after.centre[1] - before.centre[1]).max() > 0.1
    assert swings == (kind == 28)


@pytest.mark.parametrize("kind", [kind.type for kind in library().values() if kind.linear])
def test_two_ended_blocks_collide_with_nothing_and_weigh_at_their_ends(kind: int) -> None:
    ends = [part for part in Stand([(kind, 0, 2, 0, 3)]).assembly.parts if part.block == 1]
    assert [part.mass for part in ends] == [library()[kind].mass / 2] * 2
    assert not any(shape.solid for part in ends for shape in part.shapes)


def test_the_order_of_a_springs_ends_does_not_matter() -> None:
    assert spring_pull(4, 0) == pytest.approx(spring_pull(0, 4))


def test_wind_brakes_motion_across_it() -> None:
    """Before it has turned the block, which would show it more area."""
    scene = Scene(wind=(6.0, 0.0, 0.0), start=HIGH.start)
    stand = Stand([(15, 0, 0)], scene, anchored=False, gravity=True).run(0.1)
    before = stand.momentum(1)
    after = stand.run(0.05).momentum(1)
    mean, mass, fact = (before + after) / 2, stand.mass(), facts()["air"]
    braked = (after - before) / 0.05 + stand.g * mass + fact["drag"] * mean
    assert braked == pytest.approx(-fact["wind"] * 2.0 * 6.0 * mean / mass, rel=0.05)


def test_friction_is_the_geometric_mean_of_both_surfaces() -> None:
    mean = (facts()["friction"]["wood"] * 0.2) ** 0.5
    assert friction(15, 30, 0.2) == pytest.approx(mean, rel=0.025)


def test_what_a_joint_separates_collides_but_for_the_joint_and_its_parent() -> None:
    """A hinge on a log swings its wheel into the log, but turns freely on its own."""
    for wheels, reached in (([], 90.0), ([(2, 2, 0)], 47.0)):
        stand = Stand([(63, 0, 0), (28, 1, 5), *wheels])
        before = stand.world.state().rotation[2]
        after = stand.run(1.0, steering_hinges=1).world.state().rotation[2]
        assert np.degrees(2 * np.arccos(abs(before @ after))) == pytest.approx(reached, abs=1.0)


@pytest.mark.parametrize("ends", [(0, 3, 4, 9), (2, 0, 4, 8), (2, 12, 3, 0)])
def test_a_brace_is_rigid_in_every_direction(ends: tuple[int, ...]) -> None:
    """Of 7.6 m from below, of 3 m from above, and of 1 m along the hinge that it locks."""
    for brace, sinks in (([], 2.3), ([(7, *ends)], 0.0)):
        logs = [(63, 0, 4), (63, 1, 0), (5, 2, 12), (63, 3, 0), *brace]
        stand = Stand(logs, Scene(), gravity=True)
        before = stand.world.state().centre[:, 1]
        sunk = before - stand.run(2.0).world.state().centre[:, 1]
        assert sunk[4] - sunk[0] == pytest.approx(sinks, abs=0.1 if sinks else 1e-3)


def test_drag_loads_no_connection() -> None:
    """At the greatest speed, what the air takes from a cannon never reaches its connection."""
    stand = Stand([(56, 0, 2), (56, 0, 3)], anchored=False).run(10.0, motors=1)
    push = library()[56].thrust
    assert stand.momentum(1) / stand.mass() == pytest.approx(2 * push / 3.05, rel=0.01)
    assert abs(stand.reaction(1)[1]) == pytest.approx(push, rel=1e-3)


@pytest.mark.parametrize("face", range(6))
def test_all_faces_hold_equally_well(face: int) -> None:
    (joint,) = Stand([(63, 0, face)]).assembly.joints
    assert joint.strength is not None
    assert [joint.strength.force, joint.strength.torque] == facts()["strength"]["usual"]

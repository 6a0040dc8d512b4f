"""The law of springs, how their pulls act on the parts that they hold, and what damping takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import Engine
from agentflow.env.physics.laws.forces import PartLocations
from agentflow.env.physics.laws.tension import Spring, SpringForce
from agentflow.env.physics.model import Assembly
from agentflow.env.rollout import Array
from agentflow.env.scene import Scene
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.tree import Machine
from tests.env.conftest import MakeEngine
from tests.env.machines import machine
from tests.env.physics.rig import RATE, Rig


def test_a_spring_pulls_beyond_its_natural_length_only() -> None:
    locations = PartLocations(np.array([0, 1]), np.zeros((2, 3)))
    levels = {"springs": 1.0}
    spring = Spring(0, 1, natural=0.5, ramp=0.5, force=600.0, damping=10.0)
    springs = SpringForce([spring], levels, 1.0 / RATE)
    springs.locate_parts(locations)
    still = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    def pull(distance: float, rate: float = 0.0) -> list[tuple[int, Vec3, Vec3 | None]]:
        row = (distance, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, rate, 0.0, 0.0, 0.0, 0.0, 0.0)
        return springs([still, row])

    assert pull(3.0) == [
        (0, (600.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        (1, (-600.0, 0.0, 0.0), (3.0, 0.0, 0.0)),
    ]
    assert pull(0.75)[0][1] == (300.0, 0.0, 0.0)
    assert pull(0.5) == pull(0.3) == []
    assert pull(3.0, -2.0)[0][1] == pytest.approx((580.0, 0.0, 0.0))
    assert pull(3.0, -100.0)[0][1] == (0.0, 0.0, 0.0)
    levels["springs"] = 0.5
    assert pull(3.0)[0][1] == (300.0, 0.0, 0.0)
    for off in (0.0, -1.0):
        levels["springs"] = off
        assert pull(3.0) == []


def in_space(assembly: Assembly) -> Assembly:
    """Far above the ground and without drag."""
    up = 50.0
    return replace(
        assembly,
        parts=tuple(
            replace(
                part,
                centre=(part.centre[0], part.centre[1] + up, part.centre[2]),
                linear_drag=0.0,
                angular_drag=0.0,
            )
            for part in assembly.parts
        ),
        joints=tuple(
            replace(joint, pivot=(joint.pivot[0], joint.pivot[1] + up, joint.pivot[2]))
            for joint in assembly.joints
        ),
    )


def test_springs_inside_rigid_clusters_change_no_motion(make_engine: MakeEngine) -> None:
    """Also when their ends are not the parts that lead their clusters, and turn fast."""
    rows = [(0, -1, -1), (63, 0, 4), (63, 1, 0), (63, 0, 0), (63, 3, 0)]
    rows += [(22, 2, 0), (63, 5, 3), (63, 6, 0), (9, 7, 0, 6, 5), (9, 2, 3, 4, 3)]
    physics = constants().changed({"gravity": 0.0})
    tree = machine(*rows)
    engine = make_engine(physics)

    def tumble(springs: float, apart: bool) -> Array:
        assembly = in_space(assemble(tree, place(tree), physics))
        world = engine.build(assembly, Scene(), 240.0)
        world.switch("motors", 1.0)
        for _ in range(60):
            world.step()
        if apart:
            world.split([i for i, joint in enumerate(assembly.joints) if joint.block == 5])
        world.switch("springs", springs)
        for _ in range(60):
            world.step()
        assert world.speeds()[1] > 3.0
        return world.state().centre

    assert tumble(1.0, False) == pytest.approx(tumble(0.0, False), abs=1e-6)
    assert tumble(1.0, True) == pytest.approx(tumble(0.0, True), abs=1e-6)


def hinged_log(ballast: int, springs: int) -> Machine:
    """A log on a hinge, with ballast at its tip, that springs pull up to a post."""
    rows = [(0, -1, -1), (63, 0, 4), (5, 0, 3), (63, 2, 0)]
    rows += [(35, 3 + i, 0) for i in range(ballast)]
    post, log = place(machine(*rows)).blocks[1:4:2]
    inner = [face.face_id for face in post.faces if face.facing == "x+"]
    upper = [face.face_id for face in log.faces if face.facing == "y+"]
    pairs = [(a, b) for a in reversed(inner) for b in reversed(upper)]
    return machine(*rows, *((9, 1, a, 3, b) for a, b in pairs[:springs]))


@pytest.mark.parametrize(
    ("ballast", "springs", "share", "fastest"),
    [(0, 4, 0.50, 53), (1, 1, 0.82, 16), (6, 1, 0.95, 5)],
)
def test_the_faster_springs_contract_the_less_of_their_work_arrives(
    calm: Engine, ballast: int, springs: int, share: float, fastest: float
) -> None:
    """The energy of the log when the springs are half as long, over the work of the full pull."""
    tree = hinged_log(ballast, springs)
    assembly = assemble(tree, place(tree), constants())
    rig = Rig(calm, tree, assembly=in_space(assembly))
    rig.world.switch("springs", 1.0)
    first = length = rig.world.state().length
    speed = 0.0
    while length.max() > 0.5 * first.max():
        before = length
        rig.world.step(4)
        length = rig.world.state().length
        speed = max(speed, 4 * RATE * (before - length).max())
    work = constants()["spring_force"] * (first - length).sum()
    energy = rig.world.momentum()["energy"].sum()
    assert energy / work == pytest.approx(share, abs=0.01)
    assert speed == pytest.approx(fastest, abs=1)

"""Springs and winches against their laws."""

from __future__ import annotations

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import Engine
from agentflow.env.physics.laws.forces import PartLocations
from agentflow.env.physics.laws.tension import Winch, WinchForce
from agentflow.env.scene import Scene
from agentflow.machine.geometry.placement import place
from tests.env.conftest import MakeEngine
from tests.env.machines import machine
from tests.env.physics.rig import RATE, Rig, face_towards

ROOT = (0, -1, -1)
SPRING, WINCH = 9, 45


def test_a_spring_pulls_as_its_law_says(calm: Engine) -> None:
    """It pulls a suspension in, which yields by the pull along its axis over its stiffness."""
    value = constants()
    base = (ROOT, (16, 0, 4), (35, 1, 0), (15, 0, 3))
    side = face_towards(machine(*base), 2, "x+")
    top = face_towards(machine(*base), 3, "y+")
    rig = Rig(calm, machine(*base, (SPRING, 2, side, 3, top)))
    rig.run(0.5)
    assert rig.moved(2) == pytest.approx([0, 0, 0], abs=1e-6)
    rig.world.switch("springs", 1)
    rig.run(4.0)
    length = float(rig.world.state().length[0])
    stretch = min((length - value["spring_length"]) / value["spring_ramp"], 1.0)
    assert stretch == 1.0
    ends = rig.blocks[4]
    assert ends.end_a is not None
    assert ends.end_b is not None
    high, low = ends.end_a[1] + rig.moved(2)[1], ends.end_b[1]
    pull = value.of("spring_force", SPRING) * (high - low) / length
    assert rig.moved(2)[1] == pytest.approx(-pull / value["suspension_stiffness"], rel=0.01)


def test_a_spring_lets_go_at_its_natural_length(calm: Engine) -> None:
    """A log on a hinge is pulled up to the post until the spring is short."""
    base = (ROOT, (63, 0, 4), (5, 0, 3), (63, 2, 0))
    tree = machine(*base)
    post, log = face_towards(tree, 1, "x+"), face_towards(tree, 3, "y+")
    rig = Rig(calm, machine(*base, (SPRING, 1, post + 1, 3, log + 1)))
    start = float(rig.world.state().length[0])
    rig.world.switch("springs", 1)
    rig.run(0.2)
    assert rig.world.state().length[0] < start - 0.3
    rig.world.switch("springs", 0)
    before = rig.world.momentum()["energy"]
    rig.world.step()
    assert rig.world.momentum()["energy"] <= before


def test_a_winch_lifts_at_its_speed_and_lowers_again(make_engine: MakeEngine) -> None:
    """A crane on a heavy foot lifts a log on a hinge with ballast at its end."""
    engine = make_engine()
    base = (
        ROOT,
        (35, 0, 1),
        (35, 0, 2),
        (35, 0, 3),
        (63, 0, 4),
        (63, 4, 0),
        (5, 0, 0),
        (63, 6, 0),
        (35, 7, 0),
        (35, 1, 0),
        (35, 9, 0),
        (35, 10, 0),
        (35, 11, 0),
    )
    tree = machine(*base)
    load = face_towards(tree, 8, "y+")
    post = [f.face_id for f in place(tree).blocks[5].faces if f.facing == "z+"][-1]
    crane = machine(*base, (WINCH, 5, post, 8, load))
    assembly = assemble(crane, place(crane), constants())
    assert assembly.devices.springs == ()
    world = engine.build(assembly, Scene(), RATE)

    def run(seconds: float) -> float:
        for _ in range(round(seconds * RATE)):
            world.step()
        return float(world.state().length[0])

    start, low = run(0.5), world.centre(8)[1]
    world.switch("winches", 1)
    run(0.5)
    middle = run(0.5)
    later = run(0.5)
    assert middle - later == pytest.approx(0.5 * constants()["winch_speed"], rel=0.05)
    assert world.centre(8)[1] > low + 1.0
    world.switch("winches", 0)
    held = run(0.5)
    assert held == pytest.approx(later, abs=0.03)
    assert run(1.0) == pytest.approx(held, abs=0.01)
    world.switch("winches", -1)
    assert run(0.5) == pytest.approx(held + 0.5, abs=0.05)
    assert start > held


def test_a_winch_pulls_no_harder_than_its_force(calm: Engine) -> None:
    """Between the anchor and a stiff suspension at its stop it pays out what it cannot hold."""
    value = constants()
    base = (ROOT, (16, 0, 4), (35, 1, 0), (15, 0, 3))
    side = face_towards(machine(*base), 2, "x+")
    top = face_towards(machine(*base), 3, "y+")
    rig = Rig(calm, machine(*base, (WINCH, 2, side, 3, top)))
    rig.run(0.5)
    assert rig.moved(2) == pytest.approx([0, 0, 0], abs=1e-6)
    rig.world.switch("winches", 1)
    rig.run(4.0)
    ends = rig.blocks[4]
    assert ends.end_a is not None
    assert ends.end_b is not None
    length = float(rig.world.state().length[0])
    lean = (ends.end_a[1] + rig.moved(2)[1] - ends.end_b[1]) / length
    pull = -rig.moved(2)[1] * value["suspension_stiffness"] / lean
    assert pull == pytest.approx(value["winch_force"], rel=0.01)


def test_a_winch_takes_in_no_more_than_down_to_its_shortest() -> None:
    """Ends that are held 0.6 m apart feel a rope of 0.5 m, 0.1 m stretched."""
    rope = Winch(0, 1, speed=1.0, shortest=0.5, stiffness=1500.0, damping=15.0, force=600.0)
    levels = {"winches": 0.0}
    ropes = WinchForce([rope], levels, 1.0 / RATE)
    ropes.locate_parts(PartLocations(np.array([0, 1]), np.zeros((2, 3))))
    still = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    rows = [still, (0.6, *still[1:])]
    assert ropes(rows) == []
    levels["winches"] = 1.0
    for _ in range(600):
        pushes = ropes(rows)
    assert [(part, force) for part, force, _ in pushes] == [
        (0, (pytest.approx(150.0), 0.0, 0.0)),
        (1, (pytest.approx(-150.0), -0.0, -0.0)),
    ]
    levels["winches"] = -1.0
    for _ in range(120):
        pushes = ropes(rows)
    assert pushes == []

"""Flying: heights, hoops in order, platforms and gusts."""

from __future__ import annotations

import pytest

from agentflow.env.rollout import Verdict
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.families.flying import Flying, hoops_of
from agentflow.env.tasks.registry import get_task
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.tree import ROOT, Machine, Step
from agentflow.prompts.text import token_estimate

from ..fakes import LONE_ROOT, FakeWorld, make_trace

COPTER = Machine(
    (
        ROOT,
        *(Step(i + 1, 63, 0, i) for i in range(4)),
        Step(5, 22, 0, 4),
        Step(6, 22, 5, 0),
        *(Step(6 + i, 26, 6, i) for i in range(1, 5)),
    )
)
"""Four logs as feet, two rotating blocks on top of each other, four propellers."""
ROCKET = Machine((ROOT, Step(1, 14, 0, 4), Step(2, 14, 0, 0)))
"""Flying blocks on top and in front."""


def level(name: str, **knobs: object) -> Flying:
    task = get_task(name, knobs)
    assert isinstance(task, Flying)
    return task


def judge(task: Flying, *places: Vec3) -> Verdict:
    """The verdict over a root that starts at (0, 0.5, 0) and goes to these, 1 s each."""
    referee, world = task.referee(LONE_ROOT), FakeWorld()
    referee.start(world)
    for place in places:
        world.time += 1.0
        world.centres[0] = place
        referee.watch(world)
    return referee.verdict(make_trace(1))


def test_the_greatest_height_counts_and_falling_costs_nothing() -> None:
    verdict = judge(level("flying"), (0.0, 2.5, 0.0), *[(3.0, 8.0, 4.0)] * 2, (3.0, -1.5, 4.0))
    assert verdict.score == 7.5
    terms = dict(verdict.terms)
    assert (terms["height"], terms["time"], terms["end"], terms["drift"]) == (7.5, 2.0, -2.0, 5.0)
    assert (terms["passed"], terms["closest"], terms["result"]) == (None, None, None)


def test_falling_off_a_platform_is_worth_nothing() -> None:
    assert judge(level("flying/3"), (0.0, -2.0, 8.0)).score == 0.0


def test_hoops_count_in_order() -> None:
    task = level("flying/4")
    (_, y1, z1), (_, y2, z2), (_, y3, _) = (hoop.centre for hoop in task.marks)
    first, second = (0.0, y1, z1 + 1), (0.0, y2, z2 + 1)
    both = judge(task, (0.0, y1, z1 - 1), first, (0.0, y2, z2 - 1), second, (0.0, y2, 69.0))
    assert both.terms["passed"] == 2.0
    assert [event.time for event in both.events] == [2.0, 4.0]
    near = ((y3 - y2) ** 2 + 6.0**2) ** 0.5
    assert both.terms["closest"] == pytest.approx(near)
    assert both.score == pytest.approx(20.0 + 10.0 - near)
    skipping = judge(task, (0.0, 50.0, 30.0), (0.0, y2, z2 - 1), second)
    assert skipping.terms["passed"] == 0.0


def test_all_hoops_are_worth_ten_each_and_nothing_more() -> None:
    task = level("flying/4")
    path = [(x, y, z + d) for x, y, z in (hoop.centre for hoop in task.marks) for d in (-1.0, 1.0)]
    verdict = judge(task, *path)
    assert (verdict.score, verdict.terms["result"]) == (30.0, "3 of 3 passed")
    assert verdict.terms["closest"] is None


def test_a_hoop_is_passed_forward_and_inside() -> None:
    task = level("flying/4")
    _, y, z = task.marks[0].centre
    assert judge(task, (3.9, y, z - 1), (3.9, y, z + 1)).terms["passed"] == 1.0
    assert judge(task, (4.1, y, z - 1), (4.1, y, z + 1)).terms["passed"] == 0.0
    assert judge(task, (9.0, y, z + 1), (0.0, y, z + 1), (0.0, y, z - 1)).terms["passed"] == 0.0


def test_coming_close_to_the_first_hoop_is_worth_something() -> None:
    task = level("flying/4")
    _, y, z = task.marks[0].centre
    verdict = judge(task, (0.0, y, z - 4.0), (0.0, 0.5, 0.0))
    assert verdict.score == pytest.approx(6.0)
    assert verdict.terms["result"] == ("0 of 3 passed, closest to the centre of hoop 1: 4.00 m")


def test_the_start_is_a_place_of_the_flight() -> None:
    task = level("flying/4")
    _, y, z = task.marks[0].centre
    away = judge(task, (0.0, 0.5, -10.0)).terms["closest"]
    assert away == pytest.approx(((y - 0.5) ** 2 + z**2) ** 0.5)


@pytest.mark.parametrize(
    ("name", "score"), [("flying", "Score: 1.50 m"), ("flying/4", "Score: 0.00")]
)
def test_the_feedback_tells_heights_and_marks(name: str, score: str) -> None:
    task = level(name)
    verdict = judge(task, (0.0, 2.0, 0.0), (0.0, 1.0, 0.0))
    heights = [0.5, 1.0, 2.0, 1.0]
    trace = make_trace(1, 4, paths={0: [(0.0, height, 0.0) for height in heights]})
    feedback = task.feedback(LONE_ROOT, trace, (), verdict)
    first, root, marks = feedback.text.splitlines()[:3]
    assert first == score
    assert root == (
        "Root: greatest height 1.50 m above its start at 1.00 s, ends 0.50 m above it, fastest "
        "climb 5.00 m/s"
    )
    assert marks.startswith("Hoops: 0 of 3 passed, closest ") == (name == "flying/4")
    assert feedback.data["greatest_climb"] == pytest.approx(5.0)


def test_without_wind_nothing_is_told_of_gusts() -> None:
    told = " ".join(level("flying", **{"gusts.swing": 0.5}).brief.scene)
    assert "gusts" not in told


def test_hoops_stand_where_the_brief_says_and_are_the_seeds() -> None:
    task = level("flying/4")
    centres = [hoop.centre for hoop in task.marks]
    assert [z for _, _, z in centres] == [25, 50, 75]
    assert all(10 <= y <= 20 for _, y, _ in centres)
    told = " ".join(task.brief.scene)
    assert all(f"({x:g}, {y:g}, {z:g})" in told for x, y, z in centres)
    assert hoops_of(task.parameters.hoops) == task.marks
    assert level("flying/4", **{"hoops.seed": 9}).marks != task.marks
    rims = [item for item in task.scene().objects if item.name.startswith("hoop 1,")]
    inner = [((t.position[0]) ** 2 + (t.position[1] - centres[0][1]) ** 2) ** 0.5 for t in rims]
    assert min(inner) - rims[0].size[0] / 2 >= 4.0 - 1e-9


def test_only_marks_allow_the_flying_block() -> None:
    assert [14 in level(name).brief.blocks for name in ("flying", "flying/3", "flying/4")] == [
        False,
        False,
        True,
    ]
    told = " ".join(level("flying/4").brief.schedule)
    assert "flying blocks start to push in the direction they face" in told
    assert "flying blocks" not in " ".join(level("flying").brief.schedule)
    assert "Propellers have no motor" in " ".join(level("flying").brief.schedule)


def test_propellers_on_rotating_blocks_lift_off_and_without_power_they_do_not() -> None:
    task = level("flying", window=3)
    rollout = simulate(COPTER, task)
    assert rollout.score is not None
    assert rollout.score > 3.0
    control = simulate(COPTER, task, power=False)
    assert control.score == pytest.approx(0.0, abs=0.01)
    assert token_estimate(rollout.feedback.text) < 1200


def test_flying_blocks_reach_the_first_hoop() -> None:
    rollout = simulate(ROCKET, level("flying/4", window=3))
    assert rollout.terms["passed"] == 1.0


def test_a_machine_rests_on_the_tilted_platform() -> None:
    task = level("flying/3", window=1)
    rollout = simulate(Machine((ROOT, Step(1, 63, 0, 0), Step(2, 63, 0, 1))), task)
    assert rollout.trace is not None
    low, high = rollout.trace.centre[0, 2], rollout.trace.centre[0, 1]
    rise, run = high[1] - low[1], high[2] - low[2]
    assert rise / run == pytest.approx(-0.26795, abs=0.002)
    assert rollout.score == pytest.approx(0.0, abs=1e-3)


def test_gusts_blow_about_their_mean() -> None:
    scene = level("flying/5").scene()
    values = [scene.strength(0.01 * step) for step in range(20_000)]
    assert sum(values) / len(values) == pytest.approx(1.0, abs=0.01)
    assert 0.4 <= min(values) < 0.5
    assert 1.5 < max(values) <= 1.6
    assert level("flying/4").scene().gusts == ()
    told = " ".join(level("flying/5").brief.scene)
    assert "its speed changes between 2.4 and 9.6 m/s within a second or two" in told


def test_gusts_change_the_flight_and_always_in_the_same_way() -> None:
    knobs = {"window": 1, "wind.cross": 3}
    steady = simulate(ROCKET, level("flying/4", **knobs))
    gusty = [simulate(ROCKET, level("flying/4", **knobs, **{"gusts.swing": 0.5})) for _ in "ab"]
    assert gusty[0].digest == gusty[1].digest
    assert gusty[0].digest != steady.digest
    assert steady.trace is not None
    assert gusty[0].trace is not None
    same = steady.trace.centre[0] == gusty[0].trace.centre[0]
    assert same.all()


def test_the_wind_moves_nothing_before_the_window() -> None:
    """Wheels hold still with 40 N m each before t = 0, which is less than this wind pushes."""
    wheels = (Step(2 + i, 2, 1, face) for i, face in enumerate((1, 3, 4, 6)))
    cart = Machine((ROOT, Step(1, 63, 0, 0), *wheels))
    rollout = simulate(cart, level("flying/5", window=1, **{"wind.speed": -20}))
    assert rollout.trace is not None
    assert [event.kind for event in rollout.events] == []
    assert rollout.trace.centre[0, 0, 2] == pytest.approx(-1.75, abs=0.02)
    assert rollout.trace.centre[-1, 0, 2] > -1.6


def test_propellers_turn_in_wind_as_in_still_air() -> None:
    heavy = Machine((ROOT, *(Step(i + 1, 35, 0, i) for i in range(4)), *COPTER.steps[5:]))
    spins = []
    for cross in (0, 5):
        task = level("flying", **{"window": 1, "wind.cross": cross})
        trace = simulate(heavy, task).trace
        assert trace is not None
        spins.append(abs(trace.angular_velocity[-1, 10, 1] - trace.angular_velocity[-1, 0, 1]))
    assert spins[0] == pytest.approx(16.0, abs=0.5)
    assert spins[1] == pytest.approx(spins[0], abs=1.5)

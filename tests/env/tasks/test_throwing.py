"""The throwing referee on hand-made flights: what counts, what does not, and the terms."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from agentflow.env.rollout import Verdict
from agentflow.env.scene import Body
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine.tree import ROOT, Machine, Step
from benchmarks.shelf import load
from tests.env.fakes import BOULDER, THROWER, FakeWorld, make_trace

STEP = 1 / 120
Moment = tuple[float, float, float, frozenset[Body]]
"""Time, height, distance along z+, contacts of the boulder."""
HELD: frozenset[Body] = frozenset({1})
FREE: frozenset[Body] = frozenset()
DOWN: frozenset[Body] = frozenset({"ground"})


def moments(
    start: float, end: float, z: float, to: float, contacts: frozenset[Body]
) -> list[Moment]:
    """Evenly moving from z to `to`, at height 2, one moment per step in [start, end)."""
    count = round((end - start) / STEP)
    return [(start + i * STEP, 2.0, z + (to - z) * i / count, contacts) for i in range(count)]


def judge(script: Iterable[Moment], task: Task | None = None, root_z: float = 0.0) -> Verdict:
    """Let the referee watch the boulder live through the script; the root stands at root_z."""
    referee = (task or get_task("throwing")).referee(THROWER)
    world = FakeWorld(centres={BOULDER: (0.0, 2.0, 0.0)}, contacts={BOULDER: HELD})
    referee.start(world)
    for time, height, z, contacts in script:
        world.time = time
        world.centres[BOULDER] = (0.0, height, z)
        world.centres[0] = (0.0, 0.5, root_z)
        world.contacts[BOULDER] = contacts
        referee.watch(world)
    return referee.verdict(make_trace(len(THROWER)))


def test_a_throw_scores_its_distance_along_z() -> None:
    script = [
        *moments(STEP, 0.5, 0.0, 1.0, HELD),
        *moments(0.5, 0.9, 1.0, 12.0, FREE),
        (0.9, 1.0, 12.0, DOWN),
        *moments(0.9 + STEP, 2.0, 12.0, 18.0, DOWN),
    ]
    verdict = judge(script)
    assert verdict.score == 12.0
    assert verdict.terms == {
        "distance": 12.0,
        "distance_any": 12.0,
        "height": 2.0,
        "height_time": 0.0,
        "reach": 12.0,
        "rl": 0.0,
        "thrown": True,
        "in_air": False,
        "left_holder": pytest.approx(0.5 - STEP),
        "landing": 0.9,
        "landed_on": "ground",
        "root_distance": 12.0,
        "result": "thrown: the boulder left block 1 (Container) at 0.49 s and landed on the ground "
        "at 0.90 s, 12.00 m along z+",
    }
    assert [(event.kind, event.blocks) for event in verdict.events] == [
        ("left_holder", (BOULDER, 1)),
        ("landing", (BOULDER,)),
    ]


def test_the_time_of_the_landing_is_a_term() -> None:
    script = [*moments(STEP, 0.6, 0.0, 9.0, FREE), (0.6, 1.0, 9.0, DOWN)]
    assert judge(script).terms["landing"] == 0.6


def test_a_wall_ends_the_flight() -> None:
    script = [
        *moments(STEP, 0.6, 0.0, 9.0, FREE),
        (0.6, 1.0, 9.5, frozenset({"front wall"})),
        *moments(0.6 + STEP, 1.0, 9.5, 14.0, FREE),
        (1.0, 1.0, 14.0, DOWN),
    ]
    verdict = judge(script)
    assert (verdict.score, verdict.terms["landed_on"]) == (9.5, "front wall")


def test_a_throw_backwards_scores_nothing_and_says_so() -> None:
    verdict = judge([*moments(STEP, 0.6, 0.0, -8.0, FREE), (0.6, 1.0, -8.0, DOWN)])
    assert (verdict.score, verdict.terms["distance_any"]) == (0.0, 8.0)
    assert str(verdict.terms["result"]).startswith("thrown the wrong way: ")
    assert str(verdict.terms["result"]).endswith("8.00 m along z-")


def test_a_flight_shorter_than_a_fifth_of_a_second_is_none() -> None:
    landed = [*moments(STEP, 0.19, 0.0, 5.0, FREE), (0.19, 1.0, 5.0, DOWN)]
    verdict = judge(landed)
    assert verdict.score == 0.0
    assert verdict.terms["landing"] is None
    assert verdict.terms["result"] == (
        "not thrown: the boulder reached the ground without 0.2 s of free flight (carried, "
        "dropped, pushed or rolled)"
    )


def test_a_flight_of_exactly_a_fifth_of_a_second_counts() -> None:
    assert judge([*moments(STEP, 0.2, 0.0, 5.0, FREE), (0.2, 1.0, 5.0, DOWN)]).score == 5.0


def test_bouncing_on_after_a_drop_is_no_flight() -> None:
    script = [
        *moments(STEP, 0.1, 0.0, 1.0, FREE),
        (0.1, 1.0, 1.0, DOWN),
        *moments(0.1 + STEP, 0.6, 1.0, 9.0, FREE),
        (0.6, 1.0, 9.0, DOWN),
    ]
    assert judge(script).score == 0.0


def test_a_boulder_pushed_along_scores_nothing() -> None:
    script = moments(STEP, 4.0, 0.0, 30.0, frozenset({1, "ground"}))
    assert judge([*script, *moments(4.0, 4.5, 30.0, 33.0, DOWN)], root_z=28.0).score == 0.0


def test_a_boulder_carried_to_the_end_scores_nothing() -> None:
    verdict = judge(moments(STEP, 5.0, 0.0, 40.0, HELD), root_z=40.0)
    assert verdict.score == 0.0
    assert verdict.terms["left_holder"] is None
    assert verdict.terms["result"] == (
        "not thrown: at the end of the window the boulder had not been free of the machine for "
        "0.2 s"
    )


def test_a_boulder_still_in_the_air_counts_with_its_distance_by_then() -> None:
    script = [*moments(STEP, 3.0, 0.0, 1.0, HELD), *moments(3.0, 5.0, 1.0, 43.1, FREE)]
    script.append((5.0, 2.0, 43.1, FREE))
    verdict = judge(script)
    assert verdict.score == 43.1
    assert (verdict.terms["in_air"], verdict.terms["thrown"]) == (True, True)
    assert (verdict.terms["landing"], verdict.terms["landed_on"]) == (None, None)
    assert verdict.terms["result"] == (
        "thrown: the boulder left block 1 (Container) at 2.99 s and was still in the air at the "
        "end of the window (5.00 s), 43.10 m along z+ so far"
    )
    assert [event.kind for event in verdict.events] == ["left_holder"]
    text = get_task("throwing").feedback(THROWER, make_trace(len(THROWER)), (), verdict).text
    assert "at the end of the window" in text


@pytest.mark.parametrize(
    ("script", "root_z", "driven"),
    [
        ([*moments(STEP, 4.9, 0.0, 40.0, HELD), (5.0, 2.0, 40.0, FREE)], 0.0, "free for 0.1 s"),
        ([*moments(STEP, 4.0, 0.0, 40.0, HELD), (5.0, 2.0, 41.0, FREE)], 38.0, "root below it"),
        ([*moments(STEP, 4.0, 0.0, -1.0, HELD), (5.0, 2.0, -3.0, FREE)], 0.0, "backwards"),
        (
            [
                *moments(STEP, 0.1, 0.0, 1.0, FREE),
                (0.1, 1.0, 1.0, DOWN),
                *moments(0.2, 5.0, 1.0, 9.0, FREE),
            ],
            0.0,
            "bounced off the ground",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_in_the_air_at_the_end_is_no_way_round_the_rules(
    script: list[Moment], root_z: float, driven: str
) -> None:
    assert judge(script, root_z=root_z).score == 0.0, driven


def test_a_boulder_in_the_air_has_not_hit_a_target() -> None:
    task = get_task("throwing", {"score": "accuracy", "target.at": 43})
    verdict = judge([*moments(STEP, 5.0, 0.0, 43.0, FREE), (5.0, 2.0, 43.0, FREE)], task)
    assert (verdict.score, verdict.terms["target_distance"]) == (0.0, None)


def test_rings_passed_in_the_air_count() -> None:
    assert judge(THROUGH[:-1], get_task("throwing/4")).score == 10.0


def test_a_boulder_dropped_from_a_car_scores_nothing() -> None:
    script = [
        *moments(STEP, 4.0, 0.0, 30.0, HELD),
        *moments(4.0, 4.3, 30.0, 33.0, FREE),
        (4.3, 1.0, 33.0, DOWN),
    ]
    verdict = judge(script, root_z=32.0)
    assert (verdict.score, verdict.terms["distance_any"]) == (0.0, 0.0)
    assert str(verdict.terms["result"]).endswith(
        "33.00 m along z+ with the Starting Block only 1.00 m away"
    )
    assert judge(script, root_z=24.0).score == 33.0


@pytest.mark.parametrize(("driven", "score"), [(4.0, 3.0), (5.1, 0.0), (30.0, 0.0)])
def test_a_boulder_that_rolls_off_while_the_machine_drives_on_scores_nothing(
    driven: float, score: float
) -> None:
    """It leaves at -2 m and lands at 3 m, while the root goes on from 0."""
    referee = get_task("throwing").referee(THROWER)
    world = FakeWorld(centres={BOULDER: (0.0, 2.0, 0.0)}, contacts={BOULDER: HELD})
    referee.start(world)
    for time, z, root_z, contacts in (
        (0.1, -2.0, 0.0, HELD),
        (0.2, 0.0, driven / 2, FREE),
        (0.4, 3.0, driven, DOWN),
    ):
        world.time = time
        world.centres[BOULDER], world.centres[0] = (0.0, 2.0, z), (0.0, 0.5, root_z)
        world.contacts[BOULDER] = contacts
        referee.watch(world)
    verdict = referee.verdict(make_trace(len(THROWER)))
    assert verdict.score == score
    if not score:
        assert str(verdict.terms["result"]).endswith(
            f"5.00 m along z+ in flight, while the Starting Block moved {driven:.2f} m"
        )


def test_a_boulder_that_the_machine_catches_again_has_not_landed() -> None:
    script = [
        *moments(STEP, 0.5, 0.0, 3.0, FREE),
        *moments(0.5, 0.6, 3.0, 3.5, HELD),
        *moments(0.6, 0.7, 3.5, 4.0, FREE),
        (0.7, 1.0, 4.0, DOWN),
    ]
    assert judge(script).score == 0.0


def test_the_reinforcement_learning_score_multiplies_by_the_height() -> None:
    task = get_task("throwing", {"score": "rl"})
    low = [*moments(STEP, 0.6, 0.0, 9.0, FREE), (0.6, 1.0, 9.0, DOWN)]
    high = [(STEP, 6.0, 0.1, FREE), *low[1:]]
    assert judge(low, task).score == 0.0
    assert judge(high, task).score == 54.0
    assert judge(high).score == 9.0


def test_the_yard_has_four_walls_around_the_machine() -> None:
    scene = get_task("throwing").scene()
    assert [(t.name, t.position, t.size) for t in scene.objects] == [
        ("left wall", (-11, 0.75, 0.0), (0.8, 1.5, 22.8)),
        ("right wall", (11, 0.75, 0.0), (0.8, 1.5, 22.8)),
        ("back wall", (0.0, 0.75, -11), (21.2, 1.5, 0.8)),
        ("front wall", (0.0, 0.75, 11), (21.2, 1.5, 0.8)),
    ]
    assert get_task("throwing", {"wall.height": 0}).scene().objects == ()


def test_the_feedback_is_short_and_regular() -> None:
    script = [*moments(STEP, 0.6, 0.0, 9.0, FREE), (0.6, 1.0, 9.0, DOWN)]
    verdict = judge(script)
    trace = make_trace(len(THROWER), paths={BOULDER: [(0.0, 2.0, 0.1 * i) for i in range(26)]})
    feedback = get_task("throwing").feedback(THROWER, trace, (), verdict)
    assert feedback.text.splitlines() == [
        "Score: 9.00 m",
        "Result: thrown: the boulder left block 1 (Container) at 0.00 s and landed on the ground "
        "at 0.60 s, 9.00 m along z+",
        "Boulder: greatest height 2.00 m at 0.00 s, greatest horizontal distance 9.00 m",
        "Release at 0.00 s: speed 0.0 m/s, elevation 0 degrees, block 1 (Container) has turned "
        "0 degrees, now at 0.0 rad/s",
        "Broken: none",
        "Orientation of block 0: facing z+ all the time",
        "Frames: at t = 0 world = machine frame + (0.00, -0.50, 0.00)",
        "Boulder position every 0.2 s from t = 0 s (x, y, z): (0.00, 2.00, 0.00) "
        "(0.00, 2.00, 0.10) (0.00, 2.00, 0.20) (0.00, 2.00, 0.30) (0.00, 2.00, 0.40) "
        "(0.00, 2.00, 0.50)",
    ]
    assert feedback.data["boulder"] == BOULDER
    assert len(feedback.data["series"][0]["values"]) == 6


def arc(*places: tuple[float, float]) -> list[Moment]:
    """A flight that begins at 0.1 s, through these heights and distances, one each tenth."""
    return [(0.1 + 0.1 * i, y, z, FREE) for i, (y, z) in enumerate(places)]


THROUGH = [
    *moments(STEP, 0.1, 0.0, 1.0, HELD),
    *arc((4.0, 5.0), (8.0, 12.0), (8.0, 16.0), (5.0, 24.0)),
    (0.6, 1.0, 30.0, DOWN),
]


def test_one_ring_passed_scores_ten() -> None:
    verdict = judge(THROUGH, get_task("throwing/4"))
    assert verdict.score == 10.0
    assert (verdict.terms["passed"], verdict.terms["rings"]) == (1.0, 1.0)
    assert verdict.terms["closest"] is None


def test_two_rings_passed_score_twenty() -> None:
    assert judge(THROUGH, get_task("throwing/5")).score == 20.0


def test_close_to_the_second_ring_scores_in_between() -> None:
    script = [
        *moments(STEP, 0.1, 0.0, 1.0, HELD),
        *arc((4.0, 5.0), (8.0, 12.0), (8.0, 16.0), (7.0, 18.0)),
        (0.6, 1.0, 18.0, DOWN),
    ]
    verdict = judge(script, get_task("throwing/5"))
    assert verdict.score == 10.0 + 10.0 - 0.5 * 4.0
    assert (verdict.terms["passed"], verdict.terms["closest"]) == (1.0, 4.0)


def test_a_boulder_carried_through_the_ring_scores_nothing() -> None:
    script = [*moments(STEP, 1.0, 0.0, 30.0, HELD), (1.1, 1.0, 30.0, DOWN)]
    assert judge(script, get_task("throwing/4")).score == 0.0


def test_what_has_touched_the_ring_passes_no_further() -> None:
    rim: frozenset[Body] = frozenset({"ring 1, piece 3"})
    script = [
        *moments(STEP, 0.1, 0.0, 1.0, HELD),
        *arc((4.0, 5.0), (8.0, 12.0), (8.0, 13.0), (8.0, 13.9)),
        (0.5, 8.0, 13.95, rim),
        *arc((8.0, 16.0)),
        (0.9, 1.0, 24.0, DOWN),
    ]
    verdict = judge(script, get_task("throwing/5"))
    assert verdict.terms["landed_on"] == "ring 1, piece 3"
    assert verdict.terms["passed"] == 0.0


def test_accuracy_counts_half_a_point_less_per_metre_from_the_target() -> None:
    task = get_task("throwing", {"score": "accuracy", "target.at": 26})
    verdict = judge(THROUGH, task)
    assert verdict.score == 8.0
    assert verdict.terms["target_distance"] == 4.0
    assert judge(moments(STEP, 1.0, 0.0, 26.0, HELD), task).score == 0.0
    assert judge(THROUGH, get_task("throwing", {"score": "accuracy", "target.at": 51})).score == 0.0
    assert "z = 26 m" in task.brief.score[0]


def test_feedback_on_a_target_tells_how_far_from_it_the_boulder_landed() -> None:
    task = get_task("throwing", {"score": "accuracy", "target.at": 30})
    held = moments(STEP, 1.0, 0.0, 30.0, HELD)
    for script, told in ((THROUGH, "landed 0.00 m from it"), (held, "no throw landed")):
        text = task.feedback(THROWER, make_trace(len(THROWER)), (), judge(script, task)).text
        assert f"\nTarget: {told}\n" in text


@pytest.mark.parametrize("thrown", [2, 4])
def test_of_several_boulders_the_mean_counts(thrown: int) -> None:
    task = get_task("throwing", {"reload": 2})
    assert task.brief.required == {36: 2}
    steps = (ROOT, Step(1, 30, 0, 4), Step(2, 36, 1, 0), Step(3, 30, 0, 0), Step(4, 36, 3, 0))
    machine = Machine(steps)
    referee = task.referee(machine)
    world = FakeWorld(centres={2: (0.0, 2.0, 0.0), 4: (0.0, 2.0, 0.0)})
    world.contacts = {2: HELD, 4: frozenset({3})}
    referee.start(world)
    for time, z, contacts in ((0.3, 6.0, FREE), (0.6, 12.0, DOWN)):
        world.time = time
        world.centres[thrown], world.contacts[thrown] = (0.0, 2.0, z), contacts
        referee.watch(world)
    verdict = referee.verdict(make_trace(5))
    assert verdict.score == 6.0
    assert (verdict.terms["boulder"], verdict.terms["throws"]) == (thrown, "1 of 2")
    text = task.feedback(machine, make_trace(5), (), verdict).text
    assert f"Boulders: 1 of 2 thrown, the best is block {thrown} (Boulder)" in text


def test_feedback_on_rings_tells_how_close_it_came() -> None:
    task = get_task("throwing/4")
    short = [*moments(STEP, 0.1, 0.0, 1.0, HELD), *arc((7.0, 10.0)), (0.5, 1.0, 12.0, DOWN)]
    verdict = judge(short, task)
    text = task.feedback(THROWER, make_trace(len(THROWER)), (), verdict).text
    assert "Rings: passed 0 of 1, closest distance to the next ring's centre 8.00 m" in text


@pytest.mark.slow
def test_a_window_that_ends_in_mid_flight_costs_only_what_is_left_of_it() -> None:
    """The boulder leaves at 0.3 s and lands 21.7 m away at 1.6 s."""
    thrower = load("throwing/spring_arm.json")
    early, late = (simulate(thrower, get_task("throwing", {"window": w})) for w in (1.0, 2.0))
    assert early.trace is not None
    flown = early.trace.centre[:, int(early.feedback.data["boulder"]), 2]
    assert 0.3 * late.score < early.score < 0.9 * late.score
    assert early.score == pytest.approx(flown[-1] - flown[0])
    assert str(early.terms["result"]).endswith("m along z+ so far")


@pytest.mark.slow
def test_a_thrower_throws_as_far_when_all_of_it_starts_later() -> None:
    """A motor and springs swing its arm: springs alone half a second later pull a moved arm."""
    thrower = load("throwing/wind_arm.json")
    scores = [
        simulate(thrower, get_task("throwing", {"blocks.max": 0, **starts})).score
        for starts in (
            {},
            {"schedule.springs": 0.5, "schedule.motors": 0.5},
            {"schedule.springs": 0.5},
        )
    ]
    assert scores[1] == pytest.approx(scores[0], rel=0.01)
    assert scores[2] < 0.8 * scores[0]

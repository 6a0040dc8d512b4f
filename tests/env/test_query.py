"""Active queries: tables, cuts and reasons."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from agentflow.env.properties import PROPERTIES
from agentflow.env.query import answer_queries
from agentflow.env.rollout import Broken, Trace
from agentflow.env.rotations import compose
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import ROOT, Machine, Step
from agentflow.tools.bench import TOOLS
from tests.env.fakes import make_rollout, make_trace

MACHINE = Machine((ROOT, Step(1, 1, 0, 0), Step(2, 15, 1, 0), Step(3, 9, 0, 4, 2, 0)))
TRACE = make_trace(
    4,
    paths={1: [(0.1 * i, 0.0, -0.001) for i in range(26)]},
    length=np.linspace(2.0, 1.0, 26)[:, None],
    linear=(3,),
)
ROLLOUT = make_rollout(TRACE, (Broken(1, 1, 0, 0.42, 1.03),))


def ask(**query: object) -> str:
    return answer_queries(MACHINE, ROLLOUT, [query]).text


def test_a_table_has_one_row_per_sample_of_what_changes() -> None:
    given = answer_queries(
        MACHINE,
        ROLLOUT,
        [{"id": 1, "duration": [0, 0.4], "properties": ["position", "velocity"]}],
    )
    assert given.text == (
        "Block 1 (Wooden Block), 0 to 0.4 s:\n"
        "velocity (x, y, z) m/s: 0.00, 0.00, 0.00 throughout\n"
        "t s | position (x, y, z) m\n"
        "0.0 | 0.00, 0.00, 0.00\n"
        "0.2 | 0.10, 0.00, 0.00\n"
        "0.4 | 0.20, 0.00, 0.00"
    )
    assert given.data[0]["times"] == pytest.approx([0.0, 0.2, 0.4])
    assert given.data[0]["position"] == [[0.1 * i, 0.0, -0.001] for i in range(3)]
    assert given.data[0]["velocity"] == [[0.0, 0.0, 0.0]] * 3
    assert given.data[0]["broke"] is None


def test_a_table_ends_where_the_block_broke_off() -> None:
    given = answer_queries(
        MACHINE, ROLLOUT, [{"id": "1", "duration": [0, "5"], "properties": "position"}]
    )
    assert given.text.splitlines()[-2:] == [
        "0.4 | 0.20, 0.00, 0.00",
        "Block 1 (Wooden Block) broke off at 0.42 s; its table ends there.",
    ]
    assert given.data[0]["broke"] == 0.42


def test_a_block_that_broke_off_while_settling_has_no_table() -> None:
    rollout = make_rollout(TRACE, (Broken(1, 1, 0, -1.2, 1.03),))
    query = {"id": 1, "duration": [-2, 5], "properties": ["position"]}
    assert answer_queries(MACHINE, rollout, [query]).text == (
        "Query 1: no answer: Block 1 (Wooden Block) broke off at -1.20 s, while the machine "
        "settled; states before t = 0 are not recorded"
    )


def test_rows_may_be_finer_than_the_grid() -> None:
    path = {0: [(float(i), 0.0, 0.0) for i in range(101)]}
    rollout = make_rollout(make_trace(4, 101, 0.05, paths=path))
    query = {"id": 0, "duration": [0, 0.1], "properties": ["position"]}
    given = answer_queries(MACHINE, rollout, [query], interval=0.05)
    assert given.text.splitlines()[2:] == [
        "0.000 | 0.00, 0.00, 0.00",
        "0.050 | 1.00, 0.00, 0.00",
        "0.100 | 2.00, 0.00, 0.00",
    ]


def test_a_break_after_the_interval_is_not_told() -> None:
    assert ask(id=1, duration=[0, 0.2], properties=["position"]).count("\n") == 3


def test_a_broken_second_connection_does_not_cut() -> None:
    rollout = make_rollout(TRACE, (Broken(1, 1, 2, 0.42, 1.03),))
    given = answer_queries(
        MACHINE, rollout, [{"id": 1, "duration": [0, 5], "properties": ["velocity"]}]
    )
    assert len(given.data[0]["times"]) == 26


def test_two_ended_blocks_have_a_length() -> None:
    text = ask(id=3, duration=[0, 0.2], properties=["length"])
    assert text.splitlines()[1:] == ["t s | length m", "0.0 | 2.00", "0.2 | 1.96"]


@pytest.mark.parametrize("interval", [1 / 120, 0.05, 0.2])
def test_tables_stay_on_the_grid_of_a_fifth_of_a_second(interval: float) -> None:
    trace = make_trace(4, round(1 / interval) + 1, interval)
    given = answer_queries(
        MACHINE, make_rollout(trace), [{"id": 0, "duration": [0, 1], "properties": ["position"]}]
    )
    assert given.data[0]["times"] == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])


@pytest.mark.parametrize(
    ("query", "reason"),
    [
        ("position", 'a query is an object with "id", "duration" and "properties"'),
        ({"id": 1, "duration": [0, 1]}, '"properties" is missing'),
        ({"id": 9, "duration": [0, 1], "properties": ["position"]}, "there is no block 9; ids go "
         "from 0 to 3"),
        ({"id": "a", "duration": [0, 1], "properties": ["position"]}, "\"id\" must be a block id, "
         "not 'a'"),
        ({"id": True, "duration": [0, 1], "properties": ["position"]}, '"id" must be a block id, '
         "not True"),
        ({"id": 1, "duration": 2, "properties": ["position"]}, '"duration" must be [from, to] in '
         "seconds, not 2"),
        ({"id": 1, "duration": [2, 1], "properties": ["position"]}, "the interval 2 to 1 s is "
         "empty"),
        ({"id": 1, "duration": [6, 9], "properties": ["position"]}, "no sample lies between 6 and "
         "9 s; samples go from 0 to 5 s, one every 0.2 s"),
        ({"id": 1, "duration": [0, 1], "properties": []}, '"properties" must list some of '
         "position, rotation, velocity, angular_velocity, length, joint_angle, joint_speed, "
         "pull, work, load"),
        ({"id": 1, "duration": [0, 1], "properties": ["mass"]}, "unknown property 'mass'; known: "
         "position, rotation, velocity, angular_velocity, length, joint_angle, joint_speed, "
         "pull, work, load"),
        ({"id": 1, "duration": [0, 1], "properties": [["mass"]]}, "unknown property ['mass']; "
         "known: position, rotation, velocity, angular_velocity, length, joint_angle, joint_speed, "
         "pull, work, load"),
        ({"id": 1, "duration": [0, 1], "properties": ["length"]}, "block 1 (Wooden Block) has no "
         "length; only two-ended blocks have one"),
    ],
)  # fmt: skip
def test_an_invalid_query_gets_a_reason_and_the_others_their_answer(
    query: object, reason: str
) -> None:
    good = {"id": 0, "duration": [0, 0], "properties": ["position"]}
    given = answer_queries(MACHINE, ROLLOUT, [query, good])
    assert given.data[0] == {"query": query, "problem": reason}
    assert given.text.startswith(
        f"Query 1: no answer: {reason}\n\nBlock 0 (Starting Block), 0 to 0 s"
    )


def test_a_property_that_a_block_lacks_leaves_the_others() -> None:
    query = {"id": 1, "duration": [0, 0.2], "properties": ["mass", "position", "length"]}
    given = answer_queries(MACHINE, ROLLOUT, [query])
    *rows, unknown, lacking = given.text.splitlines()
    assert rows[-1] == "0.2 | 0.10, 0.00, 0.00"
    assert unknown.startswith("Not shown: unknown property 'mass'; known: position, rotation")
    assert lacking.startswith("Not shown: block 1 (Wooden Block) has no length")
    assert [len(given.data[0]["position"]), len(given.data[0]["problems"])] == [2, 2]


def test_the_loads_of_all_connections_up_to_the_first_break() -> None:
    trace = replace(
        make_trace(4, 5, 0.1),
        connections=((1, 0), (2, 1), (3, 0)),
        utilisation=np.array(
            [[0.1, 0.2, 0], [0.9, 0.3, 0], [0.7, 0.8, 0], [0.6, np.nan, 0], [2, np.nan, 0]]
        ),
    )
    rollout = make_rollout(trace, (Broken(2, 15, 1, 0.25, 1.02),))
    query = {"id": "connections", "duration": [0, 0.4], "properties": ["load"]}
    given = answer_queries(MACHINE, rollout, [query])
    assert given.text.splitlines() == [
        "All connections (block-partner), 0 to 0.200 s, then 2-1 broke off at 0.250 s:",
        "connection | load (share of strength; breaks at 1) at the end | greatest | at s",
        "2-1 | 1.02 | 1.02 | 0.200",
        "1-0 | 0.70 | 0.90 | 0.100",
    ]
    assert given.data[0]["connections"] == [[2, 1], [1, 0], [3, 0]]
    assert given.data[0]["broke"] == [2, 1, 0.25]
    after = answer_queries(MACHINE, rollout, [{**query, "duration": [0.3, 0.4]}])
    assert (after.data[0]["load"][0], after.data[0]["broke"]) == (2.0, None)
    for wrong, words in (
        ({"properties": ["position"]}, '"properties" of \'connections\' must be ["load"]'),
        ({"duration": [9, 10]}, "no sample lies between 9 and 10 s"),
        ({"duration": [0.24, 0.3]}, "no sample lies between 0.24 and 0.249999 s"),
    ):
        assert answer_queries(MACHINE, rollout, [query | wrong]).data[0]["problem"] == words


def test_only_twelve_queries_are_answered() -> None:
    queries = [{"id": 0, "duration": [0, 0], "properties": ["position"]}] * 14
    problems = [item.get("problem") for item in answer_queries(MACHINE, ROLLOUT, queries).data]
    assert problems[:12] == [None] * 12
    assert problems[12:] == ["only the first 12 queries of a call are answered"] * 2


def test_without_a_record_there_is_nothing_to_tell() -> None:
    query = {"id": 0, "duration": [0, 0], "properties": ["position"]}
    given = answer_queries(MACHINE, make_rollout(None), [query])
    reason = "nothing was recorded because the rollout ended with status invalid"
    assert given.text == f"Query 1: no answer: {reason}"


def test_no_queries_no_text() -> None:
    assert answer_queries(MACHINE, ROLLOUT, []).text == ""


WHEEL = Machine((ROOT, Step(1, 2, 0, 2)))
"""A powered wheel on a side of the root, with its Front towards x-."""


def turning_trace(speed: float, samples: int, interval: float) -> Trace:
    """The wheel turns at an even speed, rad/s, about x; the root stands still."""
    trace = make_trace(2, samples, interval)
    built = np.array(place(WHEEL)[1].quaternion)
    angles = speed * trace.times / 2
    spun = np.stack([np.sin(angles), 0 * angles, 0 * angles, np.cos(angles)], axis=1)
    trace.rotation[:, 1] = compose(spun, built)
    trace.angular_velocity[:, 1] = [speed, 0.0, 0.0]
    return trace


def test_rotations_are_degrees_about_named_axes_since_the_start() -> None:
    rollout = make_rollout(turning_trace(np.pi / 2, 3, 0.2))
    query = {"id": 1, "duration": [0, 1], "properties": ["rotation", "angular_velocity"]}
    given = answer_queries(WHEEL, rollout, [query])
    assert given.text.splitlines()[1:3] == [
        "angular velocity about x, y, z (rad/s): 1.57, 0.00, 0.00 throughout",
        "t s | turned since t = 0 about x, y, z (degrees)",
    ]
    assert given.data[0]["rotation"] == pytest.approx(np.array([[0, 0, 0], [18, 0, 0], [36, 0, 0]]))


def test_the_angle_of_a_joint_counts_turns_between_samples() -> None:
    # 30 rad/s: almost a whole turn between two samples, so that rotations alone cannot tell it
    rollout = make_rollout(turning_trace(30.0, 6, 0.2))
    query = {"id": 1, "duration": [0, 1], "properties": ["joint_angle", "joint_speed"]}
    given = answer_queries(WHEEL, rollout, [query])
    assert given.data[0]["joint_speed"] == pytest.approx([-30.0] * 6)
    assert given.data[0]["joint_angle"] == pytest.approx(-np.degrees(6.0) * np.arange(6))
    assert "angle on block 0 (degrees about its Front, which faces x- as built" in given.text
    refused = answer_queries(WHEEL, rollout, [{**query, "id": 0}]).data[0]["problem"]
    assert refused == "block 0 (Starting Block) does not turn on a parent; blocks that do: 1"


def test_the_load_of_a_row_is_the_greatest_since_the_one_before() -> None:
    trace = replace(
        make_trace(2, 9, 0.05),
        connections=((1, 0),),
        utilisation=np.array([[0.1, 0.9, 0.2, 0.2, 0.3, 0.1, 0.4, np.nan, np.nan]]).T,
    )
    query = {"id": 1, "duration": [0, 0.4], "properties": ["load"]}
    given = answer_queries(WHEEL, make_rollout(trace), [query])
    assert given.text.splitlines()[1:] == [
        "t s | load (share of strength) on 0", "0.0 | 0.10", "0.2 | 0.90", "0.4 | 0.40"
    ]  # fmt: skip
    given = answer_queries(WHEEL, make_rollout(trace), [{**query, "interval": 0.05}])
    assert given.data[0]["load"] == [0.1, 0.9, 0.2, 0.2, 0.3, 0.1, 0.4, None, None]
    assert given.text.splitlines()[-1] == "0.400 | -"


def test_a_query_may_ask_for_the_interval_between_rows() -> None:
    rollout = make_rollout(make_trace(4, 601, 1 / 120))
    query = {"id": 0, "duration": [0, 0.05], "properties": ["position"], "interval": 1 / 120}
    assert len(answer_queries(MACHINE, rollout, [query]).data[0]["times"]) == 7
    for more, words in (
        ({"duration": [0, 5]}, "these are 601 rows; a table has at most 240, so ask for"),
        ({"interval": "fine"}, "\"interval\" must be a number of seconds above 0, not 'fine'"),
        ({"interval": 0}, '"interval" must be a number of seconds above 0, not 0'),
    ):
        problem = answer_queries(MACHINE, rollout, [{**query, **more}]).data[0]["problem"]
        assert problem.startswith(words)


def test_the_tool_offers_every_property() -> None:
    (query,) = [tool for tool in TOOLS if tool.spec.name == "query"]
    items = query.spec.parameters["properties"]["queries"]["items"]["properties"]
    assert items["properties"]["items"]["enum"] == list(PROPERTIES)

"""Variants side by side: several machines in one simulation, and where each came from."""

from __future__ import annotations

import asyncio
import json

import pytest

from agentflow.report.lineage import Lineage
from agentflow.runs import Event
from agentflow.runs.events import typed_event
from agentflow.tools import Bench
from agentflow.tools.designing import _renumbered
from agentflow.tools.measuring import _breaks, _moment_text
from tests.tools.benches import CAR, open_bench
from tests.tools.test_repeat import repeat


async def make_variants(bench: Bench, count: int) -> list[str]:
    """A car, and variants of it with one block less each, which say so."""
    names: list[str] = []
    for gone in range(count):
        blocks = json.dumps(json.loads(CAR)[: len(json.loads(CAR)) - gone])
        given = {"machine": blocks, "note": f"{gone} blocks less"}
        made = await bench.call("check", {**given, "parent": names[0]} if names else given)
        assert not made.refused, made.text
        names.append(made.data["machine"])
    return names


@pytest.mark.slow
async def test_several_machines_are_simulated_at_once_and_compared() -> None:
    async with open_bench(rollouts=4) as (bench, record):
        names = await make_variants(bench, 3)
        alone = await bench.call("simulate", {"machine": names[0]})
        told = await bench.call("simulate", {"machine": [*names, names[0]]})
        assert [row["machine"] for row in told.data["results"]] == names
        assert [row["note"] for row in told.data["results"]] == [
            "0 blocks less", "1 blocks less", "2 blocks less"
        ]  # fmt: skip
        assert told.data["results"][0]["score"] == alone.data["score"]
        assert told.data["simulations_left"] == 1  # the first was known
        lines = told.text.splitlines()
        assert lines[0] == "machine | score | status | first break | result | note"
        assert lines[1].startswith(f"{names[0]} | {alone.data['score']:.2f} | ok | none | Root: ")
        assert lines[4] == "`simulate` one of them alone for its feedback, at no cost."
        evaluated = [label for kind, label in record.events if kind == "evaluation"]
        assert evaluated[1:] == [f"env_feedback/traj-1/candidate-{n}/call-5" for n in (1, 2, 3)]
        machines = {known.machine.digest: known.machine for known in bench.machines}
    events = [typed_event(Event(*key, data)) for key, data in record.events.items()]
    async with open_bench(rollouts=4) as (again, repeated):
        await repeat(again, events, machines)
    assert repeated.events == record.events


def test_the_table_tells_the_decisive_moment_and_the_first_break() -> None:
    release = {"speed": 24.06, "elevation": 38.2}
    moment = {"name": "release", "time": 0.31}
    assert _moment_text({"release": release, "moment": moment}) == (
        "24.1 m/s at 38 degrees, 0.31 s"
    )
    assert _moment_text({"release": None, "moment": None}) == "none"
    assert _breaks({}, [(7, 2, 0.25), (4, 3, 1.5)]) == "7 off 2 at 0.25 s"
    assert _breaks({}) == ""
    trials = [{"first_break": item} for item in (None, [4, 0, 2.633], None, [1, 0, 2.6])]
    assert _breaks({"trials": trials}) == (
        "4 off 0 at 2.63 s in trial 2; something breaks in 2 of 4 trials (2, 4)"
    )


@pytest.mark.slow
async def test_too_many_for_the_budget_are_refused_together() -> None:
    async with open_bench(rollouts=2) as (bench, _):
        names = await make_variants(bench, 3)
        refused = await bench.call("simulate", {"machine": names})
        assert refused.text == "this takes 3 simulations, and 2 are left"
        unknown = await bench.call("simulate", {"machine": [names[0], "deadbeef"]})
        assert unknown.text.startswith("there is no machine 'deadbeef'")
        assert "2 of 2 simulations left" in bench.budget_text
        many = await bench.call("simulate", {"machine": ["x"] * 9})
        assert "List should have at most 8 items" in many.text
        # two calls at the same time share what they both ask for
        both = await asyncio.gather(
            bench.call("simulate", {"machine": names[:2]}),
            bench.call("simulate", {"machine": names[1]}),
        )
        assert [result.refused for result in both] == [False, False]
        assert "0 of 2 simulations left" in bench.budget_text


async def test_history_and_tree_show_where_a_machine_came_from() -> None:
    async with open_bench(stage="initial", rollouts=None, looks=None) as (bench, record):
        first, second = await make_variants(bench, 2)
        table = await bench.call("history", None)
        assert table.text.splitlines()[2].split(" | ")[:4] == [
            second, str(len(json.loads(CAR)) - 1), first, "1 blocks less"
        ]  # fmt: skip
        refused = await bench.call("check", {"machine": CAR, "parent": "deadbeef"})
        assert refused.text.startswith("there is no machine 'deadbeef'")
        machines = {known.machine.digest: known.machine for known in bench.machines}
    events = [typed_event(Event(*key, data)) for key, data in record.events.items()]
    nodes = [node for node in Lineage.of(events).finish(None) if node.machine]
    assert [node.parent for node in nodes] == [None, nodes[0].id]
    assert [node.edit for node in nodes] == ["0 blocks less", "1 blocks less"]
    async with open_bench(stage="initial", rollouts=None, looks=None) as (again, _):
        await repeat(again, events, machines)
        assert (await again.call("history", None)).text == table.text


@pytest.mark.parametrize(
    ("ids", "told"),
    [
        ({0: 0, 1: 1}, []),
        ({0: 0, 1: None, 2: 1}, ["2 is now 1"]),
        ({0: 0, 1: 4, 2: 1, 3: 2, 4: 3}, ["1 is now 4", "2-4 are now 1-3"]),
    ],
)
def test_rows_of_renumbered_blocks_are_told_as_ranges(
    ids: dict[int, int | None], told: list[str]
) -> None:
    assert _renumbered(ids) == told


async def test_faces_that_meet_unnoticed_are_told_with_their_blocks() -> None:
    types = ((1, 0, 2), (1, 0, 3), (1, 1, 6), (1, 2, 6), (63, 3, 4))
    steps = [{"type": 0, "id": 0, "parent": -1, "face_id": -1}]
    steps += [
        {"type": kind, "id": number, "parent": parent, "face_id": face}
        for number, (kind, parent, face) in enumerate(types, start=1)
    ]
    async with open_bench(stage="initial", rollouts=None) as (bench, _):
        made = await bench.call("check", {"machine": json.dumps(steps)})
        assert "\nFaces joined by touching: 5.0 with 4.2." in made.text
        name = made.data["machine"]
        edited = await bench.call("edit", {"machine": name, "script": "Remove 5"})
        assert "joined" not in edited.text

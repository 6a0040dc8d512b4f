"""A bench does again what another one has recorded: simulations anew, answers as they were."""

from __future__ import annotations

import pytest

from agentflow.errors import DamagedError, RunError
from agentflow.machine import library, read_machine
from agentflow.machine.tree import Machine
from agentflow.runs import Event
from agentflow.runs.events import EvaluationEvent, RunEvent, typed_event
from agentflow.runs.locations import Location
from agentflow.tools import Bench
from tests.tools.benches import CAR, open_bench

CALLS = [
    ("check", {"machine": CAR}),
    ("edit", {"machine": "6c45a9a7", "script": "Add 15 to 0 in 4"}),
    ("edit", {"machine": "6c45a9a7", "script": "no command"}),
    ("simulate", {"machine": "72b0c7bb"}),
    ("simulate", {"machine": "72b0c7bb"}),
    (
        "query",
        {
            "machine": "72b0c7bb",
            "queries": [{"id": 0, "duration": [0, 1], "properties": ["position"]}],
        },
    ),
    ("look", {"machine": "6c45a9a7", "view": "side"}),
    ("submit", {"machine": "6c45a9a7"}),
]


@pytest.mark.slow
async def test_a_repeated_stage_is_the_same() -> None:
    async with open_bench() as (first, recorded):
        for name, arguments in CALLS:
            await first.call(name, arguments)
        machines = {known.machine.digest: known.machine for known in first.machines}
        history, budget = (await first.call("history", None)).text, first.budget_text
    events = [typed_event(Event(*key, data)) for key, data in recorded.events.items()]
    async with open_bench() as (second, again):
        await repeat(second, events, machines)
        assert (await second.call("history", None)).text == history
        assert (second.budget_text, second.submitted) == (budget, first.submitted)
    asked_again = again.events.pop(("tool", f"env_feedback/call-{len(CALLS) + 2}"))
    assert asked_again["tool"] == "history"
    assert again.events == recorded.events


async def test_arguments_that_models_write_differently_are_repeated_as_they_were_read() -> None:
    async with open_bench(stage="initial", rollouts=None) as (first, recorded):
        await first.call("check", {"machine": CAR})
        (known,) = first.machines
        named = f" {known.machine.digest.upper()} "
        made = await first.call("edit", {"machine": named, "script": "Add 15 to 0 in 4"})
        await first.call("submit", {"machine": made.data["machine"], "last": "true"})
        assert first.ended
        machines = {known.machine.digest: known.machine for known in first.machines}
        parents = [known.parent for known in first.machines]
    events = [typed_event(Event(*key, data)) for key, data in recorded.events.items()]
    async with open_bench(stage="initial", rollouts=None) as (second, _):
        await repeat(second, events, machines)
        assert second.ended
        assert [known.parent for known in second.machines] == parents == ["", "6c45a9a7"]


async def repeat(
    bench: Bench, events: list[RunEvent | Event], machines: dict[str, Machine]
) -> None:
    for event in events:
        assert isinstance(event, RunEvent)
        await bench.repeat(event, machines.__getitem__)


@pytest.mark.parametrize(
    "change",
    [
        {"tool": "unknown"},
        {"arguments": {"machine": "nothing", "script": "Remove 1"}},
        {"arguments": 7},
        {"arguments": {}},
    ],
)
async def test_a_forged_call_is_damage(change: dict[str, object]) -> None:
    async with open_bench(stage="initial", rollouts=None) as (first, recorded):
        await first.call("check", {"machine": CAR})
        (known,) = first.machines
        await first.call("edit", {"machine": known.name, "script": "Add 15 to 0 in 4"})
        machines = {known.machine.digest: known.machine for known in first.machines}
    events = [
        typed_event(Event(*key, data | change if data.get("tool") == "edit" else data))
        for key, data in recorded.events.items()
    ]
    async with open_bench(stage="initial", rollouts=None) as (second, _):
        with pytest.raises(RunError, match="call-2 is damaged"):
            await repeat(second, events, machines)


async def test_more_simulations_than_a_stage_may_make_are_damage() -> None:
    car = read_machine(CAR, tuple(library())).machine
    assert car is not None
    again = EvaluationEvent(
        Location("env_feedback", trajectory=1, call=1), car.digest, True, 1.0, "ok", (), None
    )
    async with open_bench(rollouts=0) as (bench, _):
        with pytest.raises(DamagedError, match=r"call-1 is damaged: all 0 simulations are used"):
            await bench.repeat(again, lambda _: car)

"""Trials of single edits at a bench: what they cost, what they tell, what they leave."""

from __future__ import annotations

import pytest

from agentflow.tools.exploring import EditTrial, trials_text
from tests.tools.benches import CAR, open_bench


async def test_each_edit_costs_a_simulation() -> None:
    async with open_bench(rollouts=4) as (bench, record):
        name = (await bench.call("check", {"machine": CAR})).data["machine"]
        refused = await bench.call("explore_edits", {"machine": name, "count": 4})
        assert refused.text == "this takes 5 simulations, and 4 are left"
        told = await bench.call("explore_edits", {"machine": name, "count": 2})
        assert "1 of 4 simulations left" in bench.budget_text
        assert told.text.startswith(f"Machine {name}: Trials of single edits around this machine")
        assert len(told.data["trials"]) == 2
        for trial in told.data["trials"]:  # the agent makes it, at no cost
            edited = await bench.call("edit", {"machine": name, "script": _lines(trial["script"])})
            again = await bench.call("simulate", {"machine": edited.data["machine"]})
            assert again.data["known"]
            assert again.data["score"] == trial["score"]
        assert "1 of 4 simulations left" in bench.budget_text
        too_many = await bench.call("explore_edits", {"machine": name, "count": 25})
        assert too_many.refused
    assert ("evaluation", "env_feedback/call-3/traj-1/candidate-3") not in record.events
    simulated = [label for kind, label in record.events if kind == "evaluation"]
    assert sum("call-3" in label for label in simulated) == 3


def _lines(script: str) -> str:
    return script.replace("; ", "\n")


def trial(edit: str, score: float | None, broken: bool = False) -> EditTrial:
    return EditTrial(edit, score, broken)


def test_gains_and_losses_are_told_and_the_others_counted() -> None:
    tried = [
        trial("Remove 12", 13.1),
        trial("Add 9 to 4 in 1 to 9 in 0", 11.8),
        trial("Move 7 to 3 in 1", 4.0, True),
        *(trial(f"Replace {block} with 1", 10.0 + block / 1000) for block in range(5)),
        trial("Remove 1", None),
    ]
    text = trials_text(10.0, True, tried)
    assert text.splitlines()[1:] == [
        "- Remove 12: +3.10, nothing breaks",
        "- Add 9 to 4 in 1 to 9 in 0: +1.80, nothing breaks",
        "- Move 7 to 3 in 1: -6.00",
        "- 5 others: +0.00",
        "- 1 without a score",
    ]
    many = [trial(f"Remove {n}", float(n)) for n in range(30)]
    lines = trials_text(15.0, False, many).splitlines()
    assert [line.split(":")[0] for line in lines[1:6]] == [
        f"- Remove {n}" for n in range(29, 24, -1)
    ]
    assert lines[6] == "- Remove 2: -13.00"
    assert lines[-1] == "- 22 others: -12.00 to +9.00"


@pytest.mark.parametrize(("score", "tried"), [(None, [trial("Remove 1", 1.0)]), (3.0, [])])
def test_nothing_is_told_without_a_score_or_a_trial(
    score: float | None, tried: list[EditTrial]
) -> None:
    assert trials_text(score, False, tried) == ""

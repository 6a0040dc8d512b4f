"""What runs cost, by hand and on the recorded run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from agentflow.agents.registry import stage_of
from agentflow.metrics.usage import Spent, summarize_usage
from agentflow.runs import read_calls, read_result

RECORDED = Path(__file__).parent.parent.parent / "runs/recorded-throwing"


def call(label: str, prompt: int, completion: int, model: str = "m") -> dict[str, Any]:
    usage = {"prompt": prompt, "completion": completion, "reasoning": 2, "cached": 1}
    return {
        "model": model,
        "request": {"role": label.partition("/")[0], "label": label},
        "reply": {"usage": usage, "latency_s": 0.5, "retries": 1},
    }


def price(model: str, usage: Mapping[str, int]) -> float | None:
    return usage["prompt"] * 2.0 if model == "m" else None


CALLS = [
    call("designer/traj-1/attempt-1", 30, 10),
    call("refiner/blind/traj-1/attempt-1", 40, 5),
    call("refiner/feedback/traj-1/round-1/node-0/try-1/attempt-1", 10, 5),
]


def test_a_bill_by_role_and_stage() -> None:
    found = summarize_usage(CALLS, price, stage_of)
    assert found.total == Spent(3, 80, 20, 6, 3, 3, 1.5, 160.0)
    assert found.total.tokens == 100
    assert list(found.roles) == ["designer", "refiner"]
    assert found.roles["refiner"] == Spent(2, 50, 10, 4, 2, 2, 1.0, 100.0)
    assert {name: spent.calls for name, spent in found.stages.items()} == {
        "initial": 1,
        "blind_refinement": 1,
        "env_feedback": 1,
    }
    assert found.token_shares == {"designer": 0.4, "refiner": pytest.approx(0.6)}


def test_one_call_without_a_price_leaves_the_sum_unknown() -> None:
    found = summarize_usage([*CALLS, call("designer/traj-2/attempt-1", 1, 1, model="other")], price)
    assert found.total.money is None
    assert found.roles["designer"].money is None
    assert found.roles["refiner"].money == 100.0
    assert summarize_usage(CALLS).total.money is None


def test_no_calls_cost_nothing() -> None:
    found = summarize_usage([])
    assert (found.total, found.roles, found.token_shares) == (Spent(), {}, {})


def test_the_recorded_run_has_as_many_calls_as_its_result_says() -> None:
    found = summarize_usage(read_calls(RECORDED), stage_of=stage_of)
    assert found.total.calls == read_result(RECORDED).calls
    assert "other" not in found.stages


def test_an_endpoint_that_reports_no_tokens_leaves_no_shares() -> None:
    assert summarize_usage([call("designer/traj-1/attempt-1", 0, 0)]).token_shares == {}

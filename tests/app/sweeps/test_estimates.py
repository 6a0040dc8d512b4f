"""Estimates compared with real runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from agentflow.agents.registry import ROLES
from agentflow.api import design
from agentflow.app.design.plan import RunPlan
from agentflow.app.sweeps.estimates import NOTHING, Estimate, estimate
from agentflow.config.run import build_config, load_document
from agentflow.errors import ConfigError
from agentflow.metrics.usage import summarize_usage
from agentflow.runs import read_calls, read_events, read_result
from agentflow.workflows.hierarchical import STRUCTURES

ROOT = Path(__file__).parents[3]
RECORDED = ROOT / "runs/recorded-throwing"
MCTS = {"strategy": "mcts"}


def of(**document: Any) -> Estimate:
    return estimate(RunPlan.of(build_config(document)))


def test_the_estimate_matches_the_recorded_run() -> None:
    """Its first attempts were all valid and its machines all different."""
    config = build_config(load_document(ROOT / "configs/small.yaml"))
    found, result = estimate(RunPlan.of(config)), read_result(RECORDED)
    (blueprint,) = (event for event in read_events(RECORDED) if event.kind == "blueprint")
    more = STRUCTURES - len(blueprint.data["build_order"])
    settings = config.settings
    calls = result.calls + more * settings.candidates * settings.trajectories
    assert (found.calls, found.rollouts) == (calls, result.rollouts)


def test_token_estimates_match_the_recorded_run() -> None:
    sizes: dict[str, list[int]] = {}
    for call in read_calls(RECORDED):
        characters = sum(len(message["text"]) for message in call["request"]["messages"])
        sizes.setdefault(call["request"]["role"], []).append(characters)
    for role, found in sizes.items():
        assert ROLES[role].tokens[0] == pytest.approx(sum(found) / len(found) / 4, rel=0.25)
    assert set(sizes) == set(summarize_usage(read_calls(RECORDED)).roles)


@pytest.mark.parametrize(
    ("document", "calls", "rollouts"),
    [
        ({}, 5 + 10 * 4 + 30 + 68 + 68, 8 * 22),
        ({"settings": {"search": MCTS}}, 1 + 32 + 8 + 8 * 5 + 8 * 21, 8 * 22),
        ({"settings": {"meta_designer": "off"}}, 40 + 68 + 68, 176),
        ({"settings": {"inspector": False, "querier": False}}, 5 + 70 + 68, 176),
        ({"settings": {"inspector": False, "search": MCTS}}, 1 + 32 + 40 + 168, 176),
        ({"settings": {"search": {"strategy": "random"}}}, 1 + 32 + 8 + 40 + 48, 56),
        ({"settings": {"search": {"rounds": 0}}}, 1 + 32 + 8 + 8, 16),
        ({"workflow": "iterative"}, 40 + 68 + 68, 176),
        ({"workflow": "iterative", "settings": {"search": MCTS}}, 8 + 8 + 40 + 168, 176),
        ({"workflow": "iterative", "model": {"budget": {"calls": 24}}}, 24, 176),
        ({"workflow": "single"}, 8 + 40, 48),
        ({"workflow": "random-dsl"}, 0, 24),
        ({"workflow": "random-dsl", "settings": {"max_simulations": 100}}, 0, 100),
        ({"task": "gearing", "workflow": "placement"}, 50, 50),
        ({"task": "gearing", "workflow": "random-placement"}, 0, 50),
    ],
)
def test_calls_and_rollouts(document: dict[str, Any], calls: int, rollouts: int) -> None:
    found = of(**document)
    assert (found.calls, found.rollouts) == (calls, rollouts)


def test_cost_needs_a_price_for_every_model_used() -> None:
    price = {"input": 1.0, "output": 10.0}
    assert of().money == 0.0
    assert of(model={"name": "m"}).money is None
    single = {"workflow": "single", "settings": {"trajectories": 1, "search": {"rounds": 0}}}
    priced = of(**single, model={"name": "m", "prices": {"m": price}})
    assert priced.money == pytest.approx((3230 + 10 * 220) / 1e6)
    roles = {"refiner": {"name": "other"}}
    assert of(**single, model={"name": "m", "prices": {"m": price}, "roles": roles}).money == (
        priced.money
    )
    assert (priced + of(model={"name": "m"})).money is None


def test_a_limit_on_calls_scales_tokens_and_money() -> None:
    model = {"name": "m", "prices": {"m": {"input": 1.0, "output": 10.0}}}
    whole = of(model=model)
    part = of(model={**model, "budget": {"calls": whole.calls // 3}})
    share = part.calls / whole.calls
    assert part.calls == whole.calls // 3
    assert part.prompt_tokens == pytest.approx(share * whole.prompt_tokens, abs=1)
    assert part.completion_tokens == pytest.approx(share * whole.completion_tokens, abs=1)
    assert part.money == pytest.approx(share * (whole.money or 0.0))
    assert part.rollouts == whole.rollouts  # edits without a call are simulated as well
    assert of(model={**model, "budget": {"calls": whole.calls}}) == whole


@pytest.mark.slow
def test_the_estimate_of_the_first_demo_is_what_it_takes(tmp_path: Path) -> None:
    """Of the one that the studio offers to a newcomer."""
    planned = of(workflow="hierarchical", settings={"trajectories": 2})
    made = design("throwing", settings={"trajectories": 2}, out=tmp_path, say=lambda _: None)
    result = read_result(made.run)
    assert planned.calls / 1.5 <= result.calls <= planned.calls * 1.5
    assert planned.rollouts / 1.5 <= result.rollouts <= planned.rollouts


def test_a_search_among_models_costs_at_most_as_if_the_dearest_were_asked() -> None:
    price = {"input": 1.0, "output": 10.0}
    dear = {"input": 3.0, "output": 30.0}
    alone = of(workflow="iterative", model={"name": "m", "prices": {"m": price}}).money
    both = {"m": price, "n": dear}
    found = of(
        workflow="iterative",
        settings={"models": ["m", "n"]},
        model={"name": "m", "prices": both},
    )
    assert found.money == pytest.approx(3 * (alone or 0.0))
    free = of(workflow="iterative", settings={"models": ["procedural"]})
    assert free.money == 0.0
    with pytest.raises(ConfigError, match="a price for 'n'"):
        of(
            settings={"models": ["n"]},
            model={"name": "m", "prices": {"m": price}, "budget": {"money": 1}},
        )


def test_placers_are_priced_like_the_designers_model() -> None:
    dear = {"name": "dear", "prices": {"dear": {"input": 1.0, "output": 10.0}}}
    placing = {"task": "gearing", "workflow": "placement", "settings": {"placements": 2}}
    free = {**dear, "roles": {"designer": {"name": "procedural"}}}
    assert of(**placing, model=dear).money == pytest.approx(2 * (3230 + 10 * 220) / 1e6)
    assert of(**placing, model=free).money == 0.0


def test_long_windows_and_trials_take_longer() -> None:
    single: dict[str, Any] = {
        "workflow": "single",
        "verify": False,
        "settings": {"trajectories": 1, "search": {"rounds": 0}},
    }
    assert of(**single).worker_seconds == pytest.approx(0.2)
    assert of(**single, task="delivery").worker_seconds == pytest.approx(0.4)
    assert of(**single, task="lifting").worker_seconds == pytest.approx(2.0)


def test_robust_scores_are_estimated_apart_from_the_rollouts() -> None:
    objectives = ("score", "robust", "pareto")
    plain, robust, pareto = (of(settings={"objective": name}, verify=False) for name in objectives)
    assert (plain.perturbation, robust.perturbation) == (0, 9 * plain.rollouts)
    assert robust == pareto
    assert robust.worker_seconds > 10 * plain.worker_seconds


def test_verification_is_estimated_apart_from_the_rollouts() -> None:
    found, without = of(settings={"finalists": 1}), of(verify=False)
    assert (found.rollouts, found.verification) == (176, 9)  # of a throw with motors and springs
    assert (of().rollouts, of().verification) == (176, 5 * 9)
    assert of(settings={"search": MCTS}).verification == 9
    assert (without.rollouts, without.verification) == (176, 0)
    fine = 4  # one simulation has four times as many steps
    assert found.worker_seconds - without.worker_seconds == pytest.approx((8 + fine) * 0.2)


def test_estimates_are_added() -> None:
    one = Estimate(1, 2, 3, 4.0, 5, 6, 7, 8.0)
    assert one + one == NOTHING + one.times(2) == Estimate(2, 4, 6, 8.0, 10, 12, 14, 16.0)

"""Several models as arms of one search: who was asked, what each has made, and in any order."""

from __future__ import annotations

import random
from typing import Any

import pytest

from agentflow.agents.base import AskContext
from agentflow.agents.designer import Designer
from agentflow.agents.refiner import Refiner
from agentflow.agents.registry import split_model, with_model
from agentflow.llm.messages import Client, Reply, Request
from agentflow.search.node import Evaluation
from agentflow.search.pooled.ab_mcts import AdaptiveBranching
from agentflow.search.pooled.halving import Halving
from agentflow.search.pooled.pool import Branch, Pool
from agentflow.search.tree import SearchTree
from tests.workflows.fakes import PROMPTS, Author, Run, Shelf

MODELS = ("strong (v2)", "weak")
SETTINGS: dict[str, Any] = {
    "trajectories": 3,
    "max_simulations": 60,
    "models": MODELS,
    "emitters": ["refiner", "edit"],
}


class Named:
    """A client that notes which model was asked."""

    def __init__(self, inner: Client, model: str, asked: dict[str, str]) -> None:
        self.inner, self.model, self.asked = inner, model, asked
        self.name = model

    async def complete(self, request: Request) -> Reply:
        self.asked[request.label] = self.model
        return await self.inner.complete(request)

    async def aclose(self) -> None:
        await self.inner.aclose()


class ManyModels(Run):
    """A run whose roles are asked of the models that their names end with."""

    def __init__(self, *args: Any, **more: Any) -> None:
        super().__init__(*args, **more)
        self.asked: dict[str, str] = {}

    def context(self, role: str) -> AskContext:
        own = super().context(role)
        client = Named(own.client, split_model(role)[1], self.asked)
        return AskContext(client, PROMPTS, max_retry=own.max_retry)


def with_strategy(strategy: str) -> dict[str, Any]:
    return {**SETTINGS, "search": {"strategy": strategy}}


@pytest.mark.slow
@pytest.mark.parametrize("strategy", ["halving", "ab-mcts", "half-and-half"])
@pytest.mark.parametrize("name", ["hierarchical", "iterative"])
async def test_models_are_arms_whatever_the_order_of_answers(name: str, strategy: str) -> None:
    seen = []
    for seed in range(2):
        delays = random.Random(seed)
        settings = with_strategy(strategy)
        run = ManyModels(Author(seed=5), settings, shelf=Shelf(delays=delays), delays=delays)
        result = await run(name)
        seen.append((result, run.notes.events, run.asked))
    assert all(item == seen[0] for item in seen)
    result, _, asked = seen[0]
    makers = {made.maker: made for made in result.makers}
    wanted = {with_model(role, model) for role in ("designer", "refiner") for model in MODELS}
    assert makers.keys() <= {*wanted, "edit"}
    assert {with_model(Designer.name, model) for model in MODELS} <= makers.keys()
    assert abs(sum(made.share for made in result.makers) - 1) < 1e-9
    for role in (Designer.name, Refiner.name):
        told = {model for label, model in asked.items() if label.startswith(role)}
        assert told == set(MODELS)


async def test_a_trajectory_asks_the_model_that_designed_it_but_refiners_are_chosen() -> None:
    run = ManyModels(Author(seed=5), with_strategy("ab-mcts"))
    await run("iterative")
    of = {label.split("/")[1]: m for label, m in run.asked.items() if label.startswith("designer/")}
    for label, model in run.asked.items():
        if label.startswith("querier/"):
            assert model == of[label.split("/")[1]]
    refined = [item for item in run.asked.items() if item[0].startswith("refiner/")]
    assert any(of[label.split("/")[2]] != model for label, model in refined)


@pytest.mark.parametrize("strategy", [AdaptiveBranching, Halving])
def test_the_model_whose_designs_score_more_is_asked_more_often(strategy: Any) -> None:
    pool = Pool[str](MODELS, (), None)
    for number in range(1, 21):
        branch = Branch[str](number, MODELS[number % 2], arms={0: MODELS[number % 2]})
        found = Evaluation(True, number // 2 % 5 + 2.0 * (branch.arm == MODELS[0]))
        tree = SearchTree(str(number), found, None, None, 1, lambda _: None)  # type: ignore[arg-type]
        branch.tree = tree
        pool.branches.append(branch)
    rng = random.Random(0)
    chosen = [strategy().choose(pool, rng).arm for _ in range(200)]
    assert chosen.count(MODELS[0]) > 120
    assert chosen.count(MODELS[1]) > 0


async def test_without_a_search_over_the_whole_run_no_model_is_chosen() -> None:
    run = ManyModels(Author(seed=5), with_strategy("mcts"))
    result = await run("iterative")
    assert set(run.asked.values()) == {""}
    assert result.makers == ()


@pytest.mark.parametrize("name", ["designer", "refiner (a)", "refiner (a (b))"])
def test_names_can_be_split(name: str) -> None:
    assert with_model(*split_model(name)) == name

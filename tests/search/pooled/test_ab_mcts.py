"""Adaptive branching, beside its reference implementation."""

import math
from random import Random
from typing import Any

import pytest

from agentflow.search.events import ignore
from agentflow.search.node import Attempt, Evaluation
from agentflow.search.pooled.ab_mcts import AdaptiveBranching, Posterior
from agentflow.search.pooled.pool import Branch, Choice, Pool
from agentflow.search.tree import SearchTree

treequest = pytest.importorskip("treequest")


async def never(*_: object) -> Any:
    raise AssertionError


def tree_of(score: float) -> SearchTree[float]:
    return SearchTree(score, Evaluation(True, score), never, never, 1, ignore)


def tell(pool: Pool[float], choice: Choice, score: float) -> None:
    """Add what was chosen to the pool, with its score."""
    if not choice.branch:
        number = len(pool.branches) + 1
        pool.branches.append(Branch(number, choice.arm, tree_of(score), {0: choice.arm}))
        return
    branch = pool.branches[choice.branch - 1]
    assert branch.tree is not None
    parent = branch.tree.nodes[choice.node]
    growth = branch.tree.number(parent, 1, [Attempt("", score, "")], fallback=False)
    (child,) = branch.tree.join(growth, [Evaluation(True, score)])
    branch.arms[child.id] = choice.arm


def label(pool: Pool[float], choice: Choice) -> tuple[str, float | None]:
    """What a choice continues, by its score, as all scores differ; None for the root."""
    tree = pool.branches[choice.branch - 1].tree if choice.branch else None
    return choice.arm, None if tree is None else tree.nodes[choice.node].candidate


@pytest.mark.parametrize("arms", [["a"], ["a", "b", "c"]])
@pytest.mark.parametrize("seed", range(2))
def test_chooses_as_the_reference_does(
    arms: list[str], seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """100 choices on the same scores and the same draws; the first two scores fix the scale."""
    ours, theirs, world = Random(seed), Random(seed), Random(f"scores {seed}")
    scores = [0.0, 1.0, *(world.betavariate(1 + seed, 2) for _ in range(98))]

    def draw(self: Any) -> float:
        names = ("m", "kappa", "nu", "tau_square")
        return Posterior(*(self.params[name] for name in names)).draw(theirs)

    monkeypatch.setattr("treequest.algos.ab_mcts_a.prob_state.ProbabilisticDist.draw_sample", draw)
    algorithm = treequest.ABMCTSA()
    state, pool = algorithm.init_tree(), Pool[float](arms, arms)
    chosen = []
    for score in scores:
        choice = AdaptiveBranching().choose(pool, ours)
        assert choice is not None
        state, (trial,) = algorithm.ask_batch(state, 1, arms)
        node = state.tree.get_node(trial.node_to_expand)
        assert label(pool, choice) == (trial.action, node.state)
        chosen.append(choice)
        tell(pool, choice, score)
        state = algorithm.tell(state, trial.trial_id, (score, score))
    assert {bool(choice.branch) for choice in chosen} == {True, False}
    assert {choice.arm for choice in chosen} == set(arms)


def test_draws_follow_the_posterior_of_the_reference() -> None:
    """Mean and spread of 20,000 draws, as Student's t distribution has them."""
    posterior = Posterior.given([0.2, 0.4, 0.9])
    assert posterior.mean == pytest.approx(1.5 / 4)
    rng = Random(0)
    drawn = [posterior.draw(rng) for _ in range(20_000)]
    spread = posterior.tau_squared / posterior.kappa * posterior.nu / (posterior.nu - 2)
    average = math.fsum(drawn) / len(drawn)
    assert average == pytest.approx(posterior.mean, abs=4 * math.sqrt(spread / len(drawn)))
    variance = math.fsum((value - average) ** 2 for value in drawn) / len(drawn)
    assert variance == pytest.approx(spread, rel=0.15)


def test_a_start_that_failed_is_not_continued() -> None:
    pool = Pool[float](["a"], ["a"])
    pool.branches = [Branch(1, "a"), Branch(2, "a", tree_of(1.0), {0: "a"})]
    rng = Random(0)
    chosen = [AdaptiveBranching().choose(pool, rng) for _ in range(100)]
    assert {choice.branch for choice in chosen if choice} == {0, 2}


def test_a_full_pool_begins_nothing_new() -> None:
    pool = Pool[float](["a"], ["a"], most_branches=1)
    pool.branches = [Branch(1, "a", tree_of(1.0), {0: "a"})]
    rng = Random(0)
    chosen = [AdaptiveBranching().choose(pool, rng) for _ in range(100)]
    assert {choice.branch for choice in chosen if choice} == {1}

"""Successive halving of first candidates, on numbers that are their own scores."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from math import inf
from random import Random

import pytest

from agentflow.search.events import ignore
from agentflow.search.node import Attempt, Evaluation, Node
from agentflow.search.pooled.ab_mcts import AdaptiveBranching
from agentflow.search.pooled.halving import BEGUN, KEPT, HalfAndHalf, Halving, tail
from agentflow.search.pooled.independent import Independent
from agentflow.search.pooled.pool import Branch, Choice, Pool, PooledStrategy, search_pool
from agentflow.search.tree import SearchTree

Make = Callable[[Random], float]


class Numbers:
    """A search for a high number; every number that is tried costs one of the budget."""

    def __init__(
        self,
        begin: Make,
        change: dict[str, Make],
        budget: int = 85,
        questions: float = inf,
        free: Sequence[str] = (),
    ) -> None:
        self.pool = Pool[float](["new"], list(change), free=free)
        self.asked = 0
        self._questions, self._free = questions, free
        self.tried: list[tuple[str, float]] = []
        """Who made each number that was tried, and what was made of."""
        self._begin, self._change, self._budget = begin, change, budget

    async def search(self, strategy: PooledStrategy, seed: int = 0) -> float:
        """The highest number found."""
        self._rng = Random(f"numbers {seed}")
        left = lambda: self._budget - len(self.tried)  # noqa: E731
        questions = lambda: self._questions - self.asked  # noqa: E731
        await search_pool(
            self.pool,
            strategy,
            self._open,
            self._expand,
            left,
            1,
            Random(seed),
            questions=questions,
        )
        return max(node.candidate for _, node in self.pool.nodes)

    async def _open(self, branch: Branch[float]) -> SearchTree[float]:
        self.asked += 1
        first = self._begin(self._rng)
        self.tried.append((branch.arm, first))

        async def evaluate(number: float, _label: str) -> Evaluation:
            return Evaluation(True, number)

        async def expand(*_: object) -> Sequence[Attempt[float]]:
            raise AssertionError

        return SearchTree(first, Evaluation(True, first), expand, evaluate, 1, ignore)

    async def _expand(
        self,
        branch: Branch[float],  # noqa: ARG002
        node: Node[float],
        asked: Sequence[tuple[str, str]],
        earlier: Sequence[Attempt[float]],  # noqa: ARG002
    ) -> Sequence[Attempt[float]]:
        self.tried += [(arm, node.candidate) for _, arm in asked]
        self.asked += sum(arm not in self._free for _, arm in asked)
        return [
            Attempt(label, node.candidate + self._change[arm](self._rng), arm)
            for label, arm in asked
        ]


def uniform(rng: Random) -> float:
    return rng.uniform(0, 10)


def small_step(rng: Random) -> float:
    return rng.uniform(-0.5, 0.5)


def no_step(rng: Random) -> float:
    return -rng.random()


async def test_half_of_the_budget_begins_branches() -> None:
    numbers = Numbers(uniform, {"edit": small_step})
    await numbers.search(Halving())
    makers = [maker for maker, _ in numbers.tried]
    assert makers[:BEGUN] == ["new"] * BEGUN
    assert len(numbers.tried) == 85
    assert makers.count("edit") > 30


async def test_what_never_improves_gives_way() -> None:
    """A heavy tail of first candidates; children are never better."""
    numbers = Numbers(lambda rng: rng.paretovariate(1.2), {"edit": no_step})
    await numbers.search(Halving())
    late = Counter(maker for maker, _ in numbers.tried[BEGUN:])
    assert late["new"] > late["edit"]


async def test_the_arm_that_gains_more_is_asked_more_often() -> None:
    arms: dict[str, Make] = {"strong": lambda rng: rng.uniform(-0.5, 2), "weak": no_step}
    numbers = Numbers(uniform, arms)
    await numbers.search(Halving())
    made = Counter(maker for maker, _ in numbers.tried)
    assert made["strong"] > 3 * made["weak"] > 0


async def test_a_designer_that_repeats_itself_is_soon_left() -> None:
    numbers = Numbers(lambda rng: float(rng.randrange(3)), {"edit": small_step})
    await numbers.search(Halving())
    assert 10 <= [maker for maker, _ in numbers.tried].index("edit") < 20


@pytest.mark.parametrize("seed", range(3))
async def test_it_beats_first_candidates_alone_where_changes_help(seed: int) -> None:
    found = await Numbers(uniform, {"edit": small_step}).search(Halving(), seed)
    assert found > 10.5


async def test_half_and_half_improves_the_best_one_alone() -> None:
    numbers = Numbers(uniform, {"edit": no_step})
    await numbers.search(HalfAndHalf())
    begun = [number for maker, number in numbers.tried if maker == "new"]
    assert len(begun) == 43
    assert [made for maker, made in numbers.tried if maker == "edit"] == [max(begun)] * 42


async def test_a_full_pool_only_climbs() -> None:
    numbers = Numbers(uniform, {"edit": small_step})
    numbers.pool.most_branches = 1
    await numbers.search(Halving())
    assert [maker for maker, _ in numbers.tried] == ["new"] + ["edit"] * 84


def pool_of(rewards: dict[float, float] | Sequence[float]) -> Pool[float]:
    """First candidates, each with its reward, or which are their own rewards."""
    pool = Pool[float](["new"], ["edit"])
    pairs = rewards.items() if isinstance(rewards, dict) else zip(rewards, rewards, strict=True)
    for number, (first, reward) in enumerate(pairs, start=1):
        tree: SearchTree[float] = SearchTree(
            first,
            Evaluation(True, reward),
            None,  # type: ignore[arg-type]
            None,  # type: ignore[arg-type]
            1,
            ignore,
        )
        pool.branches.append(Branch(number, "new", tree))
    return pool


def test_a_heavy_tail_is_what_the_best_exceed_the_others_by() -> None:
    """Equal ones count once."""
    assert (
        tail(pool_of((1.0, 30.0, 2.0, 9.0, 8.0, 4.0, 3.0, 3.0, 0.5, 0.1))) == (30 + 9 + 8) / 3 - 4
    )


def test_nothing_is_left_where_first_candidates_come_near_a_limit() -> None:
    even = pool_of([float(number) for number in range(1, 41)])
    assert 0 < tail(even) < 2 < (40 + 35) / 2 - 34
    assert tail(pool_of((5.0,))) == tail(pool_of((5.0, 5.0))) == 0


@pytest.mark.parametrize(("used", "many"), [(0.5, 8), (0.7, 4), (0.8, 2), (0.9, 1)])
def test_ever_fewer_branches_go_on(used: float, many: int) -> None:
    """First candidates that are nearly equal, where edits gain more than they differ by."""
    pool = pool_of([90.0, *(100 + number / 1000 for number in range(40))])
    grow(pool, 0, [95.0])
    strategy = begun(pool)
    pool.used = used
    chosen = {choice.branch for choice in choices(strategy, pool) if choice.branch}
    assert len(chosen) == many


def test_a_gain_counts_as_far_as_it_beats_the_best() -> None:
    """Edits of what is far behind gain much; they are made half of the time, in turns by chance."""
    pool = pool_of([100.0, *range(1, 40)])
    for number in range(1, 21):
        grow(pool, number, [45.0])
    made = Counter(choice.branch for choice in choices(begun(pool), pool))
    assert len(made) == KEPT[0]
    assert 90 < made.pop(1) < 135
    assert max(made.values()) < 25


def test_equal_rewards_have_no_tail_whatever_rounding_does() -> None:
    assert sum([0.1] * 6) / 6 < 0.1
    assert tail(pool_of({float(number): 0.1 for number in range(40)})) == 0


def test_draws_lie_near_the_mean() -> None:
    """After 20 edits in vain, hardly one child in ten is made by an edit."""
    pool = pool_of(range(1, 41))
    grow(pool, 39, [39.0] * 20)
    made = [choice.arm for choice in choices(begun(pool), pool)]
    assert 0 < made.count("edit") < 20


def grow(pool: Pool[float], index: int, rewards: Sequence[float]) -> None:
    """Give the first candidate of a branch children that edits made."""
    branch = pool.branches[index]
    assert branch.tree is not None
    for reward in rewards:
        id_ = len(branch.tree.nodes)
        branch.tree.nodes.append(Node(id_, reward, 0, Evaluation(True, reward)))
        branch.arms[id_] = "edit"


def begun(pool: Pool[float]) -> Halving:
    """A strategy that has begun enough branches, at half of the budget."""
    strategy = Halving()
    pool.used = 0.5
    strategy.choose(pool, Random(0))
    return strategy


def choices(strategy: Halving, pool: Pool[float]) -> list[Choice]:
    """What it would choose now, many times."""
    rng = Random(0)
    return [choice for _ in range(200) if (choice := strategy.choose(pool, rng))]


@pytest.mark.parametrize("strategy", [Halving, HalfAndHalf, AdaptiveBranching])
async def test_what_asks_nothing_goes_on_when_the_questions_are_used_up(
    strategy: type[PooledStrategy],
) -> None:
    for seed in range(5):
        arms = {"refiner": small_step, "edit": small_step}
        world = Numbers(uniform, arms, 64, questions=24, free=["edit"])
        await world.search(strategy(), seed)
        assert world.asked == 24
        assert len(world.tried) == 64
        by = Counter(arm for arm, _ in world.tried)
        assert by["edit"] == 40
        first = [arm for arm, _ in world.tried].index
        if strategy is not AdaptiveBranching:
            assert 12 <= min(first("refiner"), first("edit")) < 24, "after half of the questions"


@pytest.mark.parametrize("strategy", [Halving, HalfAndHalf, AdaptiveBranching])
async def test_no_question_is_left_over_that_could_have_been_asked(
    strategy: type[PooledStrategy],
) -> None:
    for seed in range(5):
        arms = {"refiner": small_step, "edit": small_step}
        world = Numbers(uniform, arms, 3, questions=3, free=["edit"])
        await world.search(strategy(), seed)
        assert world.asked == len(world.tried) == 3


async def test_independent_sampling_ends_with_the_questions() -> None:
    world = Numbers(uniform, {}, 64, questions=24)
    await world.search(Independent())
    assert world.asked == len(world.tried) == 24


async def test_few_evaluations_improve_one_branch_and_ask_each_time() -> None:
    for seed in range(5):
        world = Numbers(uniform, {"refiner": small_step, "edit": small_step}, 8, free=["edit"])
        await world.search(Halving(), seed)
        assert [arm for arm, _ in world.tried] == ["new", *["refiner"] * 7]

"""Advantages against brute force over all subsets, published special cases, invariances."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations, product
from math import comb, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agentflow.training.advantages import Floats, best, maxpo, novelty, pass1, pkpo, unlikeness

SIZES = range(2, 9)
RNG = np.random.default_rng(20)
GROUPS = {n: (RNG.normal(size=n), RNG.integers(0, 3, n).astype(float)) for n in SIZES}
"""Rewards without and with ties, for each group size."""

rewards_lists = st.lists(st.floats(-100, 100, width=32), min_size=3, max_size=8)


def brute_pkpo(rewards: Floats, k: int) -> list[float]:
    """Equation 33 of arXiv 2505.15201 term by term, times n / k."""
    n = len(rewards)
    sums = [0.0] * n
    for group in combinations(range(n), k):
        for i in group:
            without = [rewards[j] for j in group if j != i]
            sums[i] += max(rewards[list(group)]) - max(without)
    return [total / comb(n, k) * n / k for total in sums]


def brute_maxpo(rewards: Floats, k: int) -> list[float]:
    """Both replies of every pair in place of each other, beside all subsets without them."""
    n, found = len(rewards), []
    for i in range(n):
        gains = []
        for j in set(range(n)) - {i}:
            rest = sorted(set(range(n)) - {i, j})
            for subset in combinations(rest, k - 1):
                beside = [rewards[m] for m in subset]
                gains.append(max(rewards[i], *beside) if beside else rewards[i])
                gains[-1] -= max(rewards[j], *beside) if beside else rewards[j]
        found.append(float(np.mean(gains)))
    return found


@pytest.mark.parametrize(("n", "k"), [(n, k) for n in SIZES for k in range(2, n + 1)])
def test_pkpo_equals_brute_force(n: int, k: int) -> None:
    for rewards in GROUPS[n]:
        assert pkpo(rewards, k) == pytest.approx(brute_pkpo(rewards, k), abs=1e-12)


@pytest.mark.parametrize(("n", "k"), [(n, k) for n in SIZES for k in range(1, n)])
def test_maxpo_equals_brute_force(n: int, k: int) -> None:
    for rewards in GROUPS[n]:
        assert maxpo(rewards, k) == pytest.approx(brute_maxpo(rewards, k), abs=1e-12)


@pytest.mark.parametrize("n", SIZES)
def test_one_reply_and_all_replies_are_the_simple_cases(n: int) -> None:
    for rewards in GROUPS[n]:
        assert pkpo(rewards, 1) == pytest.approx(pass1(rewards))
        assert maxpo(rewards, 1) == pytest.approx(pass1(rewards) * n / (n - 1))
        assert pkpo(rewards, n) == pytest.approx(best(rewards))


def test_only_the_best_reply_gains_its_lead() -> None:
    assert best([1, 7, 4, 4]).tolist() == [0, 3, 0, 0]
    assert best([7, 1, 7]).tolist() == [0, 0, 0]
    assert best([-1.0, -4.0]).tolist() == [3, 0]


def test_pass1_is_the_centred_reward_and_can_be_scaled() -> None:
    assert pass1([1, 2, 6]).tolist() == [-2, -1, 3]
    assert pass1([1, 2, 6], scale=True) == pytest.approx(np.array([-2, -1, 3]) / (7**0.5 + 1e-4))
    assert pass1([0.1] * 5, scale=True) == pytest.approx([0] * 5, abs=1e-10)


@pytest.mark.parametrize("right", range(1, 6))
@pytest.mark.parametrize("k", [2, 3, 5])
def test_rewards_of_0_and_1_have_the_closed_form_of_pass_at_k(right: int, k: int) -> None:
    """A right reply counts where k - 1 others are all wrong."""
    n = 6
    rewards = [1.0] * right + [0.0] * (n - right)
    alone = comb(n - right, k - 1) / comb(n - 1, k - 1)
    assert pkpo(rewards, k) == pytest.approx([alone] * right + [0.0] * (n - right))
    found = maxpo(rewards, k)
    assert found[:right] == pytest.approx([1 - _pass(n - 1, right - 1, k)] * right)
    lost = _pass(n - 1, right, k - 1) - _pass(n - 1, right, k)
    assert found[right:] == pytest.approx([lost] * (n - right))


def _pass(n: int, right: int, k: int) -> float:
    """Chance that k of n replies, of which some are right, hold a right one."""
    return 1 - comb(n - right, k) / comb(n, k)


@pytest.mark.parametrize(
    ("advantages", "k"), [*((pkpo, k) for k in (2, 3, 4)), *((maxpo, k) for k in (1, 2, 3))]
)
def test_the_gradient_of_the_expected_maximum_is_unbiased(
    advantages: Callable[[Floats, int], Floats], k: int
) -> None:
    """All groups of 4 replies of a policy with three replies, weighted by their probability."""
    chances, rewards, n = np.array([0.5, 0.3, 0.2]), np.array([0.0, 1.0, 3.5]), 4
    slopes = np.eye(3) - chances  # of log probabilities, along the logits
    expected, exact = np.zeros(3), np.zeros(3)
    for group in product(range(3), repeat=n):
        chosen = list(group)
        weights = advantages(rewards[chosen], k) * k / n
        expected += chances[chosen].prod() * weights @ slopes[chosen]
    for group in product(range(3), repeat=k):
        chosen = list(group)
        exact += chances[chosen].prod() * rewards[chosen].max() * slopes[chosen].sum(axis=0)
    assert expected == pytest.approx(exact)
    assert abs(exact).max() > 0.05


@given(rewards_lists, st.data())
@settings(max_examples=60, deadline=None)
def test_invariances(values: list[float], data: st.DataObject) -> None:
    rewards, n = np.array(values), len(values)
    order = np.array(data.draw(st.permutations(range(n))))
    for name, most in ((pkpo, n), (maxpo, n - 1)):
        k = data.draw(st.integers(1, most))
        found, near = name(rewards, k), {"abs": 1e-9}
        assert name(rewards[order], k) == pytest.approx(found[order], **near)
        assert name(rewards + 5, k) == pytest.approx(found, **near)
        assert name(rewards * 3, k) == pytest.approx(found * 3, **near)
        ranked = found[np.argsort(rewards, kind="stable")]
        assert (np.diff(ranked) >= -1e-9).all(), "a higher reward has no lower advantage"
    assert maxpo(rewards, 2).sum() == pytest.approx(0, abs=1e-9)
    assert pass1(rewards).sum() == pytest.approx(0, abs=1e-9)
    assert (pkpo(rewards, 2) >= -1e-12).all()


@pytest.mark.parametrize(
    "advantages",
    [pass1, best, lambda r: pkpo(r, 3), lambda r: maxpo(r, 3)],
    ids=["pass1", "best", "pkpo", "maxpo"],
)
def test_replies_without_a_score_are_not_in_the_group(
    advantages: Callable[[list[float]], Floats],
) -> None:
    with_faults = advantages([nan, 2, 9, nan, 4, 3])
    assert with_faults[[1, 2, 4, 5]] == pytest.approx(advantages([2, 9, 4, 3]))
    assert with_faults[[0, 3]].tolist() == [0, 0]
    assert advantages([nan, 5, nan, nan]).tolist() == [0, 0, 0, 0]
    assert advantages([nan] * 4).tolist() == [0] * 4


def test_k_shrinks_with_the_replies_that_have_scores() -> None:
    assert pkpo([1, nan, 7, 4], 4).tolist() == best([1, nan, 7, 4]).tolist() == [0, 0, 3, 0]
    assert maxpo([1, nan, 7], 2) == pytest.approx([-6, 0, 6])


@pytest.mark.parametrize(("advantages", "k", "most"), [(pkpo, 5, 4), (pkpo, 0, 4), (maxpo, 4, 3)])
def test_k_beyond_the_group_is_refused(
    advantages: Callable[[list[float], int], Floats], k: int, most: int
) -> None:
    with pytest.raises(ValueError, match=f"k must be 1 to {most} for a group of 4, not {k}"):
        advantages([1, 2, 3, 4], k)


def test_novelty_is_the_mean_distance_to_the_nearest() -> None:
    line = np.array([0.0, 1.0, 3.0, 10.0])
    distances = abs(line[:, None] - line)
    assert novelty(distances, 1).tolist() == [1, 1, 2, 7]
    assert novelty(distances, 2).tolist() == [2, 1.5, 2.5, 8]
    assert novelty(distances, 9) == pytest.approx(distances.sum(axis=1) / 3)
    distances[1] = distances[:, 1] = nan
    assert novelty(distances, 1).tolist() == [3, 0, 3, 7]
    assert novelty([[0.0]]).tolist() == [0]


def test_unlikeness_is_the_share_of_others_of_another_kind() -> None:
    found = unlikeness(["arm", "arm", None, "spring", "arm"])
    assert found.tolist() == pytest.approx([1 / 3, 1 / 3, 0, 1, 1 / 3])
    assert unlikeness(["arm"]).tolist() == [0]
    assert unlikeness([None, None]).tolist() == [0, 0]

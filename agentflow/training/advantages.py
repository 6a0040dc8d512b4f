"""Advantages: how much each reply of a group gains or loses probability.

Pure functions of the rewards of one group: several replies to the same prompt. A reward that is
not a number (NaN) stands for a reply without a score, after a time-out or crash: it is left out
of the group, and its advantage is 0. Higher rewards are better. Groups with fewer than two scored
replies have nothing to compare: all advantages are 0.

With policy pi and group size n, (k / n) * sum of advantage_i * grad log pi(reply_i) estimates the
gradient of max@k: the expected greatest reward of k replies. The factor k is left out here, so
that advantages keep their size when k changes, and k = 1 and k = n are the two simplest cases.
"""

from collections import Counter
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from agentflow.metrics.cells import best_at

Floats = npt.NDArray[np.float64]


def pass1(rewards: npt.ArrayLike, *, scale: bool = False) -> Floats:
    """Reward minus the mean of the group: raises the expected reward of one reply.

    Shao et al., "DeepSeekMath" (arXiv 2402.03300), with `scale`; without, as in Liu et al.,
    "Understanding R1-Zero-like training" (arXiv 2503.20783).

    Args:
        rewards: Shape (n,).
        scale: Divide by the sample standard deviation of the rewards, plus 1e-4 as in TRL.

    Returns:
        Shape (n,).
    """

    def transform(scored: Floats) -> Floats:
        deviation = scored.std(ddof=1) + 1e-4 if scale else 1.0
        return np.asarray((scored - scored.mean()) / deviation)

    return _transform_scored(rewards, transform)


def best(rewards: npt.ArrayLike) -> Floats:
    """Greatest reward of the group, less what it would be without the reply.

    The best reply gets its lead over the second best, all others 0: the leave-one-out estimator
    for k = n of Tang et al., "Optimizing language models for inference time objectives using
    reinforcement learning" (arXiv 2503.19595).

    Args:
        rewards: Shape (n,).

    Returns:
        Shape (n,).
    """
    return pkpo(rewards, np.size(rewards))


def pkpo(rewards: npt.ArrayLike, k: int) -> Floats:
    """How much the reply raises the maximum, on average over its groups of k.

    The mean over all subsets of k - 1 other replies of max(reward, theirs) - max(theirs): n / k
    times s_i^(loo-1) of Walder & Karkhanis, "Pass@K policy optimization" (arXiv 2505.15201,
    equation 33), unbiased for max@k. The baseline does not exist for k = 1, which is `pass1`;
    k = n is `best`.

    Args:
        rewards: Shape (n,).
        k: From 1 to n; where fewer replies have scores, their number.

    Returns:
        Shape (n,).
    """
    k = _check_k(rewards, k, spare=0)
    if k == 1:
        return pass1(rewards)
    return _against_others(rewards, k, spare=0)


def maxpo(rewards: npt.ArrayLike, k: int) -> Floats:
    """As `pkpo`, with a baseline that makes the advantages of a group add up to 0.

    The mean over all other replies j, and all subsets of k - 1 replies without i and j, of
    max(reward_i, theirs) - max(reward_j, theirs): the leave-two-out baseline of Takashiro et
    al., "On advantage estimates for max@K policy gradients" (arXiv 2606.06080), unbiased for
    max@k. Built from the definition in its abstract; for max@k, it equals the advantage of
    OrderGrad (arXiv 2606.06096): mean maximum with the reply less that without it. k = 1 is
    n / (n - 1) times `pass1`.

    Args:
        rewards: Shape (n,).
        k: From 1 to n - 1; where fewer replies have scores, their number less 1.

    Returns:
        Shape (n,).
    """
    return _against_others(rewards, _check_k(rewards, k, spare=1), spare=1)


def novelty(distances: npt.ArrayLike, nearest: int = 3) -> Floats:
    """Mean distance of each reply to the nearest others of its group; 0 without a machine.

    Lehman & Stanley, "Abandoning objectives" (2011): the sparseness of a point among its nearest
    neighbours.

    Args:
        distances: Shape (n, n), symmetric, 0 on the diagonal; rows and columns of replies without
            a machine are NaN.
        nearest: How many others count; all if there are fewer.

    Returns:
        Shape (n,), in the unit of the distances.
    """
    between = np.array(distances, dtype=np.float64)
    np.fill_diagonal(between, np.nan)
    closest = np.sort(between, axis=1)[:, :nearest]  # NaN comes last
    known = np.isfinite(closest).sum(axis=1)
    total = np.nansum(closest, axis=1)
    return np.asarray(total / np.maximum(known, 1))


def unlikeness(kinds: Sequence[Hashable | None]) -> Floats:
    """Share of the others of its group that are of another kind; 0 for a reply without a kind.

    Args:
        kinds: n of them, such as mechanism classes; None counts for nobody.

    Returns:
        Shape (n,), from 0 to 1.
    """
    counts = Counter(kind for kind in kinds if kind is not None)
    others = max(1, counts.total() - 1)
    shares = [0 if kind is None else counts.total() - counts[kind] for kind in kinds]
    return np.array(shares, dtype=np.float64) / others


def _against_others(rewards: npt.ArrayLike, k: int, spare: int) -> Floats:
    """Mean maximum of k with the reply, less that of k - 1 + spare of the others."""

    def transform(scored: Floats) -> Floats:
        among = min(k, len(scored) - spare)
        return np.array([_gain(scored, i, among, among - 1 + spare) for i in range(len(scored))])

    return _transform_scored(rewards, transform)


def _gain(scored: Floats, index: int, k: int, without: int) -> float:
    others = np.delete(scored, index).tolist()
    own = float(scored[index])
    # The mean maximum of k - 1 others and the reply; with k = 1 it stands alone.
    together = best_at([max(own, other) for other in others], k - 1) if k > 1 else own
    return together - best_at(others, without)


def _transform_scored(rewards: npt.ArrayLike, transform: Callable[[Floats], Floats]) -> Floats:
    every = np.asarray(rewards, dtype=np.float64)
    scored, advantages = ~np.isnan(every), np.zeros(every.shape)
    if scored.sum() > 1:
        advantages[scored] = transform(every[scored])
    return advantages


def _check_k(rewards: npt.ArrayLike, k: int, spare: int) -> int:
    most = np.size(rewards) - spare
    if not 1 <= k <= most:
        raise ValueError(f"k must be 1 to {most} for a group of {np.size(rewards)}, not {k}")
    return k


@dataclass(frozen=True)
class Advantage:
    """An advantage as configurations choose it."""

    of: Callable[..., Floats]
    """The function; called with the rewards of a group, and with what it takes besides."""
    takes: frozenset[str] = frozenset()
    """The keywords of `AdvantageConfig` that it takes: k, scale."""
    spare: int = 0
    """Replies of a group that k must leave over."""

    def __call__(self, rewards: npt.ArrayLike, **given: float) -> Floats:
        """The advantages of a group."""
        return self.of(rewards, **{name: given[name] for name in self.takes})


ADVANTAGES: Mapping[str, Advantage] = MappingProxyType(
    {
        "pass1": Advantage(pass1, frozenset({"scale"})),
        "best": Advantage(best),
        "pkpo": Advantage(pkpo, frozenset({"k"})),
        "maxpo": Advantage(maxpo, frozenset({"k"}), spare=1),
    }
)
"""By the names that configurations use."""

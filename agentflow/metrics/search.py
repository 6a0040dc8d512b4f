"""Owns the numbers of searches: attempts per child, children per round, score over expansions."""

from __future__ import annotations

from collections.abc import Sequence

from agentflow.metrics.records import BLIND, CandidateRecord, ExpansionRecord, NodeRecord, RunRecord
from agentflow.metrics.validity import Rate


def attempts_per_child(expansions: Sequence[ExpansionRecord]) -> float | None:
    """Refiner calls per valid child, 1 at best; None without a child (published: avg_retry)."""
    children = sum(item.children for item in expansions)
    return sum(item.attempts for item in expansions) / children if children else None


def child_validity(expansions: Sequence[ExpansionRecord], width: int) -> Rate:
    """Children that came, with all retries, of those wanted (published: validity_rate).

    Published rates go with more than one attempt per child (100 % at 1.42), so they count what
    there is after the retries and not the single attempts.

    Args:
        expansions: Of one run; one that the budget cut short counts as wanted in full.
        width: Children that each expansion wanted; 1 in random search.
    """
    return Rate(sum(item.children for item in expansions), width * len(expansions))


def expansions_per_round(expansions: Sequence[ExpansionRecord]) -> float | None:
    """New machines per search; None without a search (published: avg_expansions_per_round).

    A published round is the whole search of one trajectory: only so random search, which makes one
    refinement in each of its 5 rounds, comes to the published 5, and best-of-4 to at most 20.
    """
    searches = {item.trajectory for item in expansions}
    return sum(item.children for item in expansions) / len(searches) if searches else None


def roots(record: RunRecord) -> dict[int, CandidateRecord]:
    """The machine that each trajectory's search began with, by trajectory.

    That of the last stage before the search: after a blind refinement, which may leave a trajectory
    without a valid machine, else the initial one.
    """
    starts = record.stage(BLIND) or record.stage("initial")
    searched = {node.trajectory for node in record.nodes}
    searched |= {item.trajectory for item in record.expansions}
    return {start.trajectory: start for start in starts if start.trajectory in searched}


def best_after_rounds(record: RunRecord, rounds: int) -> dict[int, float]:
    """Each search's best score when it had run for so many rounds, its root included.

    A tree is a pure function of seed and replies, so a longer search cut here is the shorter one.
    Searches without any score are left out.
    """
    return _best(record, [node for node in record.nodes if node.round <= rounds])


def best_after_expansions(record: RunRecord, nodes: int) -> dict[int, float]:
    """Each search's best score when it had made so many machines, its root included.

    A search that ended earlier keeps its last.
    """
    return _best(record, [node for node in record.nodes if node.id <= nodes])


def deepest(record: RunRecord) -> int:
    """Rounds of the longest search of a run."""
    return max((item.round for item in record.expansions), default=0)


def _best(record: RunRecord, nodes: Sequence[NodeRecord]) -> dict[int, float]:
    scores = {
        trajectory: [start.score] if start.valid and start.score is not None else []
        for trajectory, start in roots(record).items()
    }
    for node in nodes:
        if node.valid and node.score is not None:
            scores.setdefault(node.trajectory, []).append(node.score)
    return {trajectory: max(found) for trajectory, found in sorted(scores.items()) if found}

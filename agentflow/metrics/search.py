"""Numbers of searches: attempts per child, children per search, best score over expansions."""

from collections.abc import Iterable, Sequence

from agentflow.metrics.intervals import Rate
from agentflow.runs.events import CandidateEvent, ExpandEvent, NodeEvent
from agentflow.runs.locations import BLIND, INITIAL
from agentflow.runs.record import RunRecord


def attempts_per_child(expansions: Sequence[ExpandEvent]) -> float | None:
    """Refiner calls per valid child, at best 1; None without children (published as avg_retry)."""
    children = sum(item.valid for item in expansions)
    return sum(len(item.attempts) for item in expansions) / children if children else None


def child_validity(expansions: Sequence[ExpandEvent], width: int) -> Rate:
    """Valid children after all retries, out of those wanted (published as validity_rate).

    The published table has a rate of 100 % with 1.42 attempts per child, so the rate counts
    children after retries, not attempts. `width` children are wanted per expansion, even if the
    budget ran out; it is 1 in random search.
    """
    return Rate(sum(item.valid for item in expansions), width * len(expansions))


def expansions_per_round(runs: Iterable[Sequence[ExpandEvent]]) -> float | None:
    """New machines per search; None without searches (published as avg_expansions_per_round).

    A published "round" is the whole search of one trajectory: random search makes one refinement in
    each of its 5 rounds and is published with 5, best-of-4 with at most 20.
    """
    items = [(run, item) for run, expansions in enumerate(runs) for item in expansions]
    searches = {(run, item.location.trajectory) for run, item in items}
    return sum(item.valid for _, item in items) / len(searches) if searches else None


def search_roots(record: RunRecord) -> dict[int, CandidateEvent]:
    """The machine that each trajectory's search started from, by trajectory.

    It comes from the last stage before the search: blind refinement, if there was one (which may
    leave a trajectory without a valid machine), else the initial stage.
    """
    starts = record.of_stage(BLIND) or record.of_stage(INITIAL)
    searched = {node.location.trajectory for node in record.nodes}
    searched |= {item.location.trajectory for item in record.expansions}
    return {start.trajectory: start for start in starts if start.trajectory in searched}


def best_after_rounds(record: RunRecord, rounds: int) -> dict[int, float]:
    """Each search's best score after this many rounds, its root included.

    A tree depends only on seed and replies, so a longer search cut off here equals a shorter one.
    Searches without any score are left out.
    """
    return _best(record, [node for node in record.nodes if node.round <= rounds])


def best_after_expansions(record: RunRecord, nodes: int) -> dict[int, float]:
    """Each search's best score after this many new machines, its root included.

    A search that ended earlier keeps its last score.
    """
    return _best(record, [node for node in record.nodes if (node.location.node or 0) <= nodes])


def most_rounds(record: RunRecord) -> int:
    """Number of rounds of the longest search of a run."""
    return max((item.location.round for item in record.expansions), default=0)


def _best(record: RunRecord, nodes: Sequence[NodeEvent]) -> dict[int, float]:
    scores = {
        trajectory: [start.score] if start.valid and start.score is not None else []
        for trajectory, start in search_roots(record).items()
    }
    for node in nodes:
        if node.valid and node.score is not None:
            scores.setdefault(node.location.trajectory, []).append(node.score)
    return {trajectory: max(found) for trajectory, found in sorted(scores.items()) if found}

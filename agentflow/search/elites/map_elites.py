"""MAP-Elites: keep the best candidate of each kind, and expand those expanded least."""

from __future__ import annotations

from agentflow.search.elites.archive import Archive
from agentflow.search.events import ArchiveOpened, Filed, Observer, ignore
from agentflow.search.node import C, Evaluate, Evaluation, Expand, Node, SearchResult
from agentflow.search.settings import SearchSettings
from agentflow.search.tree import SearchTree


async def map_elites(
    root: C,
    evaluation: Evaluation,
    expand: Expand[C],
    evaluate: Evaluate[C],
    settings: SearchSettings,
    observe: Observer = ignore,
    archive: Archive[C] | None = None,
) -> SearchResult[C]:
    """Each round, expand one elite into `settings.width` children and file them in the archive.

    The elite is one that was expanded least often, of these the best. The
    published algorithm draws it at random; this choice needs no random stream, and every elite has
    its turn. Children that belong to no cell are not expanded. Without any elite, the best node is.
    Kinds come from `Evaluation.measurements`, which `evaluate` makes.

    Arguments as for `mcts`; `settings.ucb` is not used. `archive` is an empty one, for an `expand`
    that reads it during the search; by default one over the axes of the root's measurements.
    """
    if archive is None:
        archive = Archive([item.axis for item in evaluation.measurements])
    tree = SearchTree(root, evaluation, expand, evaluate, settings.request_rounds, observe)
    observe(ArchiveOpened(0, archive.axes))
    observe(Filed(0, tree.nodes[0], archive.offer(tree.nodes[0])))
    for round_ in tree.rounds(settings.rounds):
        elite = min(archive.elites.values(), key=_turn, default=tree.best())
        elite.visits += 1
        for child in await tree.grow(elite, round_, settings.width):
            observe(Filed(round_, child, archive.offer(child)))
    return tree.result(tree.best())


def _turn(elite: Node[C]) -> tuple[int, float, int]:
    """What elites are ordered by: expansions, then reward from the highest, then age."""
    return elite.visits, -(elite.evaluation.reward or 0.0), elite.id

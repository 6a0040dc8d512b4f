import math

import pytest

from agentflow.search.mcts import reward_range, select, ucb
from agentflow.search.node import Evaluation, Node
from agentflow.search.settings import UcbSettings


def node(id_: int, score: float | None, parent: int | None = 0, **books: object) -> Node[str]:
    return Node(id_, "", parent, Evaluation(valid=True, score=score), reward=score, **books)  # type: ignore[arg-type]


def test_upper_confidence_bound() -> None:
    assert ucb(8, 2, 6.0, (1.0, 4.0), 2.0) == (3 - 1) / 4 + 2 * math.sqrt(math.log(8) / 2)
    assert ucb(8, 0, 0.0, (0.0, 1.0), 2.0) == math.inf
    assert ucb(1, 1, 3.0, (0.0, 1.0), 5.0) == 3.0


def test_reward_range_spans_the_current_tree_including_the_root() -> None:
    minmax, raw = UcbSettings(), UcbSettings(scale="none")
    nodes = [node(0, -2.0, None), node(1, 3.0), node(2, None)]
    assert reward_range(nodes, minmax) == (-2.0, 5.0)
    assert reward_range(nodes, raw) == (0.0, 1.0)
    assert reward_range([node(0, 4.0, None)], minmax) == (4.0, 1.0)
    assert reward_range([node(0, None, None)], minmax) == (0.0, 1.0)


@pytest.mark.parametrize("metres", [1.0, 1000.0])
def test_scaling_makes_selection_independent_of_the_unit(metres: float) -> None:
    """Raw scores: 1 visited thrice, mean 2; 2 visited once, 1.5. Scaled, the rarer one wins."""
    nodes = [
        node(0, 0.0, None, children=[1, 2], visits=4, total=7.5 * metres),
        node(1, 2.0 * metres, visits=3, total=6.0 * metres),
        node(2, 1.5 * metres, visits=1, total=1.5 * metres),
    ]
    assert [n.id for n in select(nodes, UcbSettings())] == [0, 2]
    raw = select(nodes, UcbSettings(c=2.0, scale="none"))
    assert [n.id for n in raw] == ([0, 2] if metres == 1.0 else [0, 1])


def test_ties_go_to_the_lower_id() -> None:
    nodes = [
        node(0, 1.0, None, children=[1, 2], visits=2, total=2.0),
        node(1, 1.0, visits=1, total=1.0),
        node(2, 1.0, visits=1, total=1.0),
    ]
    assert select(nodes, UcbSettings())[-1].id == 1

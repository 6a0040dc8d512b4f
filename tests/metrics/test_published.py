"""The packaged copy of the published results."""

from __future__ import annotations

import pytest

from agentflow.errors import UnknownNameError
from agentflow.metrics.published import check_source, player_means, published


def test_every_published_number_is_there() -> None:
    rows = published()
    assert len(rows) == 952
    first = rows[0]
    assert (first.table, first.task, first.model) == (
        "hierarchical_stages",
        "throwing",
        "Gemini 2.5 Pro",
    )
    assert (first.condition, first.metric, first.value) == ("initial", "valid", "5")
    assert {item.value for item in rows if item.metric == "mean_ci95"} >= {"[3.53, 6.40]"}


def test_means_of_the_players() -> None:
    assert player_means() == {"flying": 256.19, "delivery": 88.8, "jumping": 10, "lifting": 10}


def test_unknown_tables_are_refused() -> None:
    check_source("mcts_depth")
    with pytest.raises(UnknownNameError, match="unknown published table 'depth'; known: mcts_dep"):
        check_source("depth")

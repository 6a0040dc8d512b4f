"""The packaged copy of the published results."""

from __future__ import annotations

import pytest

from agentflow.errors import UnknownNameError
from agentflow.metrics.intervals import wilson
from agentflow.metrics.published import SOURCES, check_source, player_means, published


def test_every_published_number_is_there() -> None:
    rows = published()
    assert len(rows) == 1000
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


def test_success_rates_of_buildarena_have_the_intervals_of_their_counts() -> None:
    found = {
        (row.task, row.model, row.metric): row.value
        for row in published()
        if row.table == "buildarena"
    }
    rates = {key[:2]: value for key, value in found.items() if key[2] == "success"}
    assert len(rates) == 24
    assert rates["rocket/1-3", "Grok-4"] == "21.9%"
    samples = 3 * 64
    for key, printed in rates.items():
        count = round(float(printed.rstrip("%")) / 100 * samples)
        assert abs(100 * count / samples - float(printed.rstrip("%"))) < 0.051, key
        ends = wilson(count, samples)
        assert ends is not None
        assert found[(*key, "success_95")] == f"{ends.low:.1%} - {ends.high:.1%}"
    assert "arXiv:2510.16559" in SOURCES["buildarena"]


def test_a_mean_over_levels_is_of_each_of_them() -> None:
    first = next(row for row in published() if row.table == "buildarena")
    assert first.tasks == {"bridge/1", "bridge/2", "bridge/3"}
    assert published()[0].tasks == {"throwing"}

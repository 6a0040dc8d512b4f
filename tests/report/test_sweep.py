"""What the page of a sweep says."""

from __future__ import annotations

from agentflow.metrics.scores import Scores
from agentflow.metrics.tables import PUBLISHED, Column, Row, Table
from agentflow.metrics.validity import Rate
from agentflow.report.sweep import sweep_data

TABLE = Table(
    title="Hand",
    heads=("task",),
    columns=(Column("mcts", "mean"), Column("", "valid"), Column("", "share", percent=True)),
    rows=(Row(("throwing",), (1.25, Rate(3, 4), 0.5)),),
    published=(Row(("<b>",), ("2.0", None, None)),),
    notes=("a note",),
)


def test_tables_are_texts_and_spreads_have_intervals() -> None:
    data = sweep_data("Title", "about", {"mcts": Scores((2.0, 1.0, 3.0), 1)}, [TABLE])
    assert data["tables"] == [
        {
            "title": "Hand",
            "head": ["task", "mcts mean", "valid", "share"],
            "labels": 1,
            "rows": [["throwing", "1.25", "3/4", "50.00%"]],
            "published": [["<b>", "2.0", "-", "-"]],
            "publishedTitle": PUBLISHED,
            "notes": ["a note"],
        }
    ]
    (spread,) = data["spreads"]
    assert (spread["name"], spread["values"], spread["mean"]) == ("mcts", [0.0, 1.0, 2.0, 3.0], 1.5)
    assert 0.0 <= spread["low"] < 1.5 < spread["high"] <= 3.0


def test_tables_without_columns_are_left_out_and_nothing_has_no_interval() -> None:
    empty = Table("Empty", ("task",), (), (Row(("throwing",), ()),))
    data = sweep_data("Title", "", {"none": Scores((), 0)}, [empty])
    assert data["tables"] == []
    assert data["spreads"] == [
        {"name": "none", "values": [], "mean": None, "low": None, "high": None}
    ]


def test_many_scores_are_thinned_evenly() -> None:
    data = sweep_data("", "", {"many": Scores(tuple(map(float, range(1000))), 0)}, [])
    values = data["spreads"][0]["values"]
    assert (len(values), values[0], values[-1]) == (334, 0.0, 999.0)

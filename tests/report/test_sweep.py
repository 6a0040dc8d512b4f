"""What the page of a sweep says."""

from __future__ import annotations

from dataclasses import replace

from agentflow.metrics.cells import Scores
from agentflow.metrics.intervals import Rate
from agentflow.metrics.tables import PUBLISHED, Column, Row, Table
from agentflow.report.sweep import DASH, Spread, sweep_data, table_data

TABLE = Table(
    title="Hand",
    heads=("task",),
    columns=(
        Column("env_feedback", "mean"),
        Column("", "valid"),
        Column("", "share", percent=True),
    ),
    rows=(Row(("throwing",), (1.25, Rate(3, 4), 0.5)),),
    published=(Row(("<b>",), ("2.0", None, None)),),
    notes=("8 runs", "a note"),
)


def test_tables_are_texts_and_spreads_have_intervals() -> None:
    spreads = {("throwing", "best_of_n"): Spread(Scores((2.0, 1.0, 3.0), 1))}
    data = sweep_data("Title", "about", spreads, [TABLE, replace(TABLE, notes=("8 runs",))])
    assert data["notes"] == ["8 runs"]
    assert data["tables"][0] == {
        "title": "Hand",
        "scored": True,
        "heads": ["task"],
        "columns": [["refinement with feedback", "mean"], ["", "valid"], ["", "share"]],
        "rows": [["throwing", "1.25", "3/4", "50.0\u00a0%"]],
        "published": [["<b>", "2.0", DASH, DASH]],
        "publishedTitle": PUBLISHED,
        "notes": ["a note"],
    }
    (spread,) = data["spreads"]
    assert (spread["task"], spread["name"]) == ("throwing", "best of n")
    assert (spread["values"], spread["mean"]) == ([0.0, 1.0, 2.0, 3.0], 1.5)
    assert (spread["count"], spread["invalid"]) == (4, 1)
    assert 0.0 <= spread["low"] < 1.5 < spread["high"] <= 3.0


def test_a_leaderboard_keeps_columns_of_zeros_and_has_words_of_its_own() -> None:
    table = Table("", ("model",), (Column("lifting", "first"),), (Row(("m",), (0.0,)),))
    assert table_data(table)["columns"] == []
    kept = table_data(table, words={"first": "one reply"}, zeros=True)
    assert (kept["columns"], kept["rows"]) == ([["lifting", "one reply"]], [["m", "0.00"]])


def test_tables_without_columns_are_left_out_and_nothing_has_no_interval() -> None:
    empty = Table("Empty", ("task",), (), (Row(("throwing",), ()),))
    data = sweep_data("Title", "", {("throwing", "none"): Spread(Scores((), 0))}, [empty])
    assert data["tables"] == []
    (spread,) = data["spreads"]
    assert (spread["values"], spread["mean"], spread["low"], spread["high"]) == ([], None) + (
        (None,) * 2
    )


def test_columns_that_say_nothing_are_left_out_and_names_are_words() -> None:
    columns = (Column("", "calls"), Column("", "tokens"), Column("", "avg_speed"), Column("", "x"))
    rows = (
        Row(("my_model", "no_inspector", "blind_refinement"), (3, 0, None, Rate(0, 2))),
        Row(("my_model", "no_inspector", "meta_designer"), (0, 0, 0.0, Rate(0, 2))),
    )
    notes = ("Tokens. tokens: of all calls. x: many.", "avg_speed: fast", "calls: all")
    table = Table("Title: usage", ("model", "variant", "of"), columns, rows, notes=notes)
    other = Table("Title", ("task",), columns[:1], (Row(("t",), (1,)),))
    (shown, _) = sweep_data("Title", "", {}, [table, other])["tables"]
    assert shown["title"] == "usage"
    assert shown["columns"] == [["", "calls"], ["", "x"]]
    assert shown["rows"] == [
        ["my_model", "no inspector", "refinement without simulation", "3", "0/2"],
        ["my_model", "no inspector", "meta designer", "0", "0/2"],
    ]
    assert shown["notes"] == ["Tokens. x: many.", "calls: all"]


def test_many_scores_are_thinned_evenly() -> None:
    many = {("throwing", "many"): Spread(Scores(tuple(map(float, range(1000))), 0))}
    values = sweep_data("", "", many, [TABLE])["spreads"][0]["values"]
    assert (len(values), values[0], values[-1]) == (334, 0.0, 999.0)

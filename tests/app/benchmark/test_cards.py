"""Scorecards and leaderboards: what is counted, what is refused, how cards are ranked."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from agentflow.app.benchmark.card import (
    Cost,
    CountedMachine,
    ItemResult,
    Point,
    Scorecard,
    is_counted,
    read_card,
    summary,
    write_card,
)
from agentflow.app.benchmark.leaderboard import format_tables, leaderboard, read_cards
from agentflow.app.benchmark.page import leaderboard_data
from agentflow.env.tasks.registry import FAMILIES
from agentflow.errors import AgentflowError, UsageError
from agentflow.files.documents import sealed
from agentflow.metrics.intervals import Rate

SHIPPED = Path(__file__).parents[3] / "docs" / "cards"
MISSING = CountedMachine(outcome="missing", score=None, share=None, reason="the run is unfinished")


def scored(share: float, fragile: bool | None = None) -> CountedMachine:
    return CountedMachine(outcome="scored", score=10 * share, share=share, fragile=fragile)


def item(name: str, firsts: tuple[float, ...], refined: CountedMachine) -> ItemResult:
    return ItemResult(
        item=name,
        family=name.partition("-")[0],
        task=name.replace("-", "/"),
        knobs={},
        full=10.0,
        parts={"first": tuple(map(scored, firsts)), "refined": (refined,)},
    )


def card(model: str, *items: ItemResult, **conditions: Any) -> Scorecard:
    return Scorecard(
        agentflow="0",
        conditions={
            "version": 1,
            "lite": False,
            "constants": "c",
            "engine": "pybullet 3.2.7",
            **conditions,
        },
        digest="0123456789abcdef",
        model=model,
        sampling={},
        made="2026-01-01",
        complete=all(map(is_counted, items)),
        total=summary(items),
        families={each.family: summary([each]) for each in items},
        items=items,
        cost=Cost(calls=13, prompt_tokens=100, completion_tokens=50, money=None, rollouts=10),
    )


GOOD = card(
    "good", item("throwing-1", (0.5, 0.25), scored(0.75)), item("flying-1", (0.0,), scored(1))
)
POOR = card(
    "poor", item("throwing-1", (0.1, 0.1), scored(0.2)), item("flying-1", (0.0,), scored(0))
)
HALF = card("half", item("throwing-1", (0.9, 0.9), scored(0.9)), item("flying-1", (0.0,), MISSING))


BOARD = """\
Benchmark version 1, pybullet 3.2.7 (0123456789abcdef)

                            refined                 first
rank  model   share            95 %   share          95 %  calls  tokens  money  rollouts
-----------------------------------------------------------------------------------------
1     good   87.50%  75.0% - 100.0%  18.75%  0.0% - 37.5%     13     150      -        10
2     poor   10.00%    0.0% - 20.0%   5.00%  0.0% - 10.0%     13     150      -        10
-     half   90.00%               -  45.00%  0.0% - 90.0%     13     150      -        10

INCOMPLETE: half lacks 1 of 2 items: flying-1.
Shares are scores divided by the greatest possible score of the item or, if there is none, by the \
record, averaged over items; an invalid machine counts as 0. refined: verified score of the best \
machine of a run with feedback. first: plain scores of single replies without feedback. Intervals \
are bootstrap intervals over items, each with all its seeds.
Cards are ranked by refined.

Shares by family

              throwing          flying
model   first  refined  first  refined
--------------------------------------
good   37.50%   75.00%  0.00%  100.00%
poor   10.00%   20.00%  0.00%    0.00%
half   90.00%   90.00%  0.00%        -

Shares by item

                                             good             poor             half
item        family    full score   first  refined   first  refined   first  refined
-----------------------------------------------------------------------------------
throwing-1  throwing  10.00       37.50%   75.00%  10.00%   20.00%  90.00%   90.00%
flying-1    flying    10.00        0.00%  100.00%   0.00%    0.00%   0.00%        -
"""


def written(folder: Path, name: str, of: Scorecard) -> Path:
    path = folder / f"{name}.json"
    write_card(path, of)
    return path


def test_a_card_is_read_as_it_was_written(tmp_path: Path) -> None:
    assert read_card(written(tmp_path, "a", GOOD)) == GOOD


def test_the_page_of_a_leaderboard_has_every_family_and_every_failure() -> None:
    poor, half = leaderboard_data([POOR, HALF])["cards"]
    assert poor["families"]["flying"]["refined"]["mean"] == 0.0
    assert (half["complete"], half["outcomes"]["refined"]) == (False, {"scored": 1, "missing": 1})


def test_the_page_of_a_leaderboard_shows_the_machines_that_count() -> None:
    data = leaderboard_data([read_card(SHIPPED / "procedural.json")])
    assert data["title"].startswith("Benchmark version 2, mujoco ")
    assert data["about"] == "1 model on 33 items, 3 per family"
    items = data["cards"][0]["items"]
    assert [items[0]["item"], round(items[0]["share"], 4)] == ["throwing-1", 0.1675]
    assert {item["machine"] for item in items} == set(data["machines"])
    [poor] = leaderboard_data([POOR])["cards"]
    assert {item["machine"] for item in poor["items"]} == {None}


def test_requirements_are_counted_where_items_have_some() -> None:
    keeps = scored(0.75).model_copy(update={"met": (1, 2)})
    card_of_both = card(
        "new", item("throwing-1", (0.5,), keeps), item("flying-1", (0.0,), scored(1))
    )
    *_, by_item = leaderboard([card_of_both])
    assert [row.values for row in by_item.rows] == [(0.5, 0.75, Rate(1, 2)), (0.0, 1.0, None)]


def test_cards_of_programs_that_were_not_isolated_say_so() -> None:
    loose = GOOD.model_copy(update={"isolated": False})
    told = "good: not isolated: its program could read and change everything here."
    assert [told in leaderboard([card])[0].notes for card in (loose, GOOD)] == [True, False]


def test_fragile_machines_are_counted_where_somebody_looked(tmp_path: Path) -> None:
    """Cards of old versions do not say; beside a new one they have no number."""
    fragile, sturdy = scored(0.75, fragile=True), scored(1, fragile=False)
    new = card("new", item("throwing-1", (0.5,), fragile), item("flying-1", (0.0,), sturdy))
    assert (new.fragile, GOOD.fragile) == (1, None)
    (tmp_path / "old").mkdir()
    written(tmp_path / "old", "card", POOR)
    cards = read_cards([written(tmp_path, "new", new), tmp_path / "old"])
    ranking, _, by_item = leaderboard(cards)
    at = [(column.group, column.name) for column in ranking.columns].index(("refined", "fragile"))
    assert [row.values[at] for row in ranking.rows] == [1, None]
    assert [row.values for row in by_item.rows] == [
        (0.5, 0.75, "yes", 0.1, 0.2, None),
        (0.0, 1.0, "no", 0.0, 0.0, None),
    ]


def test_a_missing_item_counts_neither_as_nothing_nor_as_complete() -> None:
    assert (GOOD.complete, HALF.complete, HALF.missing) == (True, False, ("flying-1",))
    assert HALF.total["refined"].mean == 0.9
    parts = {"first": (scored(1.0), MISSING), "refined": (scored(1),)}
    partly = item("a-1", (), scored(1)).model_copy(update={"parts": parts})
    assert partly.share("first") is None


def test_cards_are_ranked_by_refined_share_and_incomplete_ones_last(tmp_path: Path) -> None:
    paths = [written(tmp_path, each.model, each) for each in (HALF, POOR, GOOD)]
    tables = leaderboard(read_cards(paths))
    assert format_tables(tables, "text") == BOARD
    assert "| 1 | good | 87.50% |" in format_tables(tables, "md")
    assert len(format_tables(tables, "json").splitlines()) == 3


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"version": 2}, "they differ in version; make both with the same version of the"),
        ({"version": 2, "constants": "d"}, "they differ in version and constants; make both"),
        ({"engine": "mujoco 4.0.1"}, "they differ in engine (pybullet 3.2.7, mujoco 4.0.1); make"),
    ],
)
def test_cards_of_different_versions_are_not_mixed(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    a, b = written(tmp_path, "a", GOOD), written(tmp_path, "b", card("x", *POOR.items, **changes))
    with pytest.raises(AgentflowError) as caught:
        read_cards([a, b])
    assert str(caught.value).startswith(f"{b} and {a} cannot be compared: {message}")


def test_a_lite_card_beside_a_whole_one_says_what_to_run(tmp_path: Path) -> None:
    lite = card("x", *POOR.items, lite=True, records="other")
    a, b = written(tmp_path, "a", GOOD), written(tmp_path, "b", lite)
    for paths in ([a, b], [b, a]):
        with pytest.raises(UsageError) as caught:
            read_cards(paths)
        assert str(caught.value) == (
            f"{b} is a card of the lite benchmark and {a} of the whole one, so they cannot be "
            "compared: make both with --lite, or both without it"
        )


def test_forged_cards_without_what_others_have_are_refused(tmp_path: Path) -> None:
    a, b = written(tmp_path, "a", GOOD), written(tmp_path, "b", card("x", *POOR.items[:1]))
    with pytest.raises(AgentflowError, match="has other items or families than"):
        read_cards([a, b])
    content = json.loads(a.read_text())
    del content["conditions"]["engine"]
    a.write_text(json.dumps(sealed(content)))
    with pytest.raises(AgentflowError, match="is damaged: conditions"):
        read_card(a)


def test_damaged_and_edited_cards_say_what_to_change(tmp_path: Path) -> None:
    path = written(tmp_path, "card", GOOD)
    content = json.loads(path.read_text())
    items = [{**content["items"][0], "full": 1.0}, content["items"][1]]
    lacking = {key: value for key, value in content.items() if key != "items"}
    again = "make it again with: agentflow benchmark"
    cases = {
        "{": "is not a scorecard: expected the card.json that agentflow benchmark writes",
        "[]": "is not a scorecard: expected the card.json that agentflow benchmark writes",
        '{"a": 1}': "is not a scorecard: expected the card.json that agentflow benchmark writes",
        json.dumps({**content, "schema": 9}): (
            "has schema 9, but this version reads only schema 2: use the agentflow version that "
            f"wrote it, or {again}"
        ),
        json.dumps(sealed(lacking)): f"is damaged: items is missing; {again}",
        json.dumps({**content, "cost": {**content["cost"], "calls": "many"}}): (
            f"is damaged: cost.calls expected a whole number; {again}"
        ),
        json.dumps({**content, "items": items}): (
            f"was edited after it was written; restore it, or {again}"
        ),
        json.dumps({**content, "seal": "0"}): (
            f"was edited after it was written; restore it, or {again}"
        ),
    }
    for text, message in cases.items():
        path.write_text(text)
        with pytest.raises(AgentflowError) as caught:
            read_card(path)
        assert str(caught.value) == f"{path} {message}"
    with pytest.raises(AgentflowError, match=r"cannot read .*nowhere.json: No such file"):
        read_card(tmp_path / "nowhere.json")


def more(name: str, share: float, area: float | None, seeds: int = 1) -> ItemResult:
    """An item with another part."""
    found = tuple(
        scored(share).model_copy(
            update={
                "seed": seed,
                "area": area,
                "course": (
                    Point(simulations=1, tokens=9, money=None, share=share / 2),
                    Point(simulations=3, tokens=20, money=None, share=share),
                ),
            }
        )
        for seed in range(seeds)
    )
    old = item(name, (0.5,), scored(share))
    return old.model_copy(update={"parts": {"first": old.parts["first"], "long": found}})


def test_cards_are_compared_by_the_parts_that_all_have(tmp_path: Path) -> None:
    long = card("long", more("throwing-1", 0.8, 0.6, seeds=2), more("flying-1", 0.4, 0.2))
    (ranking, *_) = leaderboard([long])
    columns = [column.full for column in ranking.columns]
    assert columns[:5] == ["long share", "long 95 %", "first share", "first 95 %", "long area"]
    assert ranking.rows[0].values[4] == pytest.approx(0.4)
    assert columns[5] == "seeds"
    assert any(note.startswith("area: mean share of the best machine") for note in ranking.notes)
    page = leaderboard_data([long])
    assert page["parts"] == ["long", "first"]
    assert page["cards"][0]["course"] == [(1, pytest.approx(1 / 3)), (3, pytest.approx(2 / 3))]

    both = [written(tmp_path, each.model, each) for each in (long, GOOD)]
    cards = read_cards(both)
    assert [each.parts for each in cards] == [("first",)] * 2
    assert [each.model for each in cards] == ["long", "good"], "ranked by what both have"
    other = card(
        "other", *(each.model_copy(update={"parts": {"x": (scored(1),)}}) for each in GOOD.items)
    )
    with pytest.raises(UsageError, match="have no part in common: make them with the same --part"):
        read_cards([*both, written(tmp_path, "other", other)])


def test_forged_parts_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, "card", GOOD)
    content = json.loads(path.read_text())
    parts = content["items"][0]["parts"]
    parts["first"][0]["seed"] = 7
    path.write_text(json.dumps(sealed(content)))
    with pytest.raises(AgentflowError, match="its seeds are not 0, 1 and so on"):
        read_card(path)
    del parts["first"]
    path.write_text(json.dumps(sealed(content)))
    with pytest.raises(AgentflowError, match="its items and families have other parts than its"):
        read_card(path)


def test_leaderboards_of_sets_with_pars_tell_their_rules() -> None:
    pars = card("new", *GOOD.items, pars=True)
    told = "\n".join(leaderboard([pars])[0].notes)
    assert "Shares are 0 % at an item's floor and 100 % at its par" in told
    assert "an invalid machine counts as 0" in told
    assert "record" not in told


def test_the_shipped_cards_are_complete_and_of_all_items() -> None:
    procedural, random = read_cards([SHIPPED / "procedural.json", SHIPPED / "random-dsl.json"])
    assert procedural.model == "procedural (no language model)"
    assert random.model == "none (random edits)"
    assert procedural.complete
    assert random.complete
    assert [len(family) for family in (procedural.families, procedural.items)] == [11, 33]


def test_the_card_of_the_recorded_language_model_is_labelled_and_of_all_families() -> None:
    names = ("language-model", "eleven-items-procedural.json", "eleven-items-random.json")
    model, procedural, random = read_cards([SHIPPED / name for name in names])
    assert model.model == "large language model (recorded)"
    assert [set(card.families) for card in (model, procedural, random)] == [set(FAMILIES)] * 3
    assert model.complete
    assert model.parts == ("first", "search")
    assert [len(item.parts["first"]) for item in model.items] == [2] * len(FAMILIES)
    calls = {run.name: run / "calls.jsonl" for run in (SHIPPED / "language-model/runs").iterdir()}
    assert sum(len(file.read_text().splitlines()) for file in calls.values()) == model.cost.calls

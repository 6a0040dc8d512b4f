"""Leaderboards: scorecards side by side, ranked by verified scores."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from agentflow.app.benchmark.card import NAME, ItemResult, Scorecard, read_card
from agentflow.env.tasks.records import other_recorders
from agentflow.errors import RunError, UsageError
from agentflow.metrics.formats import number
from agentflow.metrics.intervals import Rate, missing_scipy
from agentflow.metrics.tables import FORMATS, Column, Row, Table, Value

INTERVAL = "95 %"
ABOUT = (
    "Shares are scores divided by the greatest possible score of the item or, if there is none, "
    "by the record, averaged over items; an invalid machine counts as 0. refined: verified score "
    "of the best machine of a run with two rounds of feedback; cards are ranked by it. first: "
    "plain scores of single replies without feedback. Intervals are bootstrap intervals over items."
)
OF_FRAGILE = (
    "fragile: number of items whose best machine fails under some small change of masses, "
    "friction, drives or time step."
)


def read_cards(paths: Sequence[Path]) -> list[Scorecard]:
    """Read cards that can be compared, best first.

    Raises:
        RunError: A file is not a card, is damaged, or was edited.
        UsageError: The cards are of different versions.
    """
    cards = [read_card(path / NAME if path.is_dir() else path) for path in paths]
    first = cards[0]
    for path, card in zip(paths, cards, strict=True):
        if different := [
            f"{key} ({value}, {card.conditions.get(key)})" if key == "engine" else key
            for key, value in first.conditions.items()
            if card.conditions.get(key) != value
        ]:
            if "lite" in different:
                lite, full = (path, paths[0]) if card.conditions["lite"] else (paths[0], path)
                raise UsageError(
                    f"{lite} is a card of the lite benchmark and {full} of the whole one, so they "
                    "cannot be compared: make both with --lite, or both without it"
                )
            raise UsageError(
                f"{path} and {paths[0]} cannot be compared: they differ in "
                f"{' and '.join(different)}; make both with the same version of the benchmark and "
                "of agentflow"
            )
        if _contents(card) != _contents(first):
            raise RunError(
                f"{path} has other items or families than {paths[0]}, which is of the same "
                "benchmark; make it again with: agentflow benchmark"
            )
    return sorted(cards, key=lambda card: (not card.complete, -(card.total.refined.mean or 0.0)))


def _contents(card: Scorecard) -> tuple[list[str], list[str]]:
    return list(card.families), [item.item for item in card.items]


def leaderboard(cards: Sequence[Scorecard], checked: Sequence[str] = ()) -> tuple[Table, ...]:
    """Three tables: all cards ranked, with what `check_cards` found; by family, and by item."""
    return _ranking(cards, checked), _by_family(cards), _by_item(cards)


def format_tables(tables: Sequence[Table], form: str) -> str:
    """Tables one after the other, in one of the `FORMATS`; JSON is one object per line."""
    return ("" if form == "json" else "\n").join(FORMATS[form](table) for table in tables)


def _ranking(cards: Sequence[Scorecard], checked: Sequence[str]) -> Table:
    columns = (
        Column("refined", "share", percent=True),
        Column("refined", INTERVAL, percent=True, digits=1),
        *[Column("refined", "fragile")] * tell_fragile(cards),
        Column("first", "share", percent=True),
        Column("first", INTERVAL, percent=True, digits=1),
        *(Column("", name) for name in ("calls", "tokens", "money", "rollouts")),
    )
    rows = []
    for place, card in enumerate(cards, start=1):
        cost, total = card.cost, card.total
        values: tuple[Value, ...] = (
            *(total.refined.mean, total.refined.interval),
            *[card.fragile] * tell_fragile(cards),
            *(total.first.mean, total.first.interval),
            *(cost.calls, cost.prompt_tokens + cost.completion_tokens, cost.money, cost.rollouts),
        )
        rows.append(Row((str(place) if card.complete else "-", card.model), values))
    conditions = cards[0].conditions
    lite = ", lite" if conditions["lite"] else ""
    engine = conditions["engine"]
    title = f"Benchmark version {conditions['version']}{lite}, {engine} ({cards[0].digest})"
    incomplete = [
        f"INCOMPLETE: {card.model} lacks {len(card.missing)} of {len(card.items)} items: "
        f"{', '.join(card.missing)}."
        for card in cards
        if not card.complete
    ]
    loose = [
        f"{card.model}: not isolated: its program could read and change everything here."
        for card in cards
        if card.isolated is False
    ]
    others = other_recorders([engine])
    of_records = f"The records were simulated by {others}." if others else ""
    about = (ABOUT, *[OF_FRAGILE] * tell_fragile(cards))
    notes = (*checked, *loose, *incomplete, *about, *filter(None, [of_records, missing_scipy()]))
    return Table(title, ("rank", "model"), columns, tuple(rows), notes=notes)


def _by_family(cards: Sequence[Scorecard]) -> Table:
    names = list(cards[0].families)
    columns = tuple(
        Column(name, part, percent=True) for name in names for part in ("first", "refined")
    )
    rows = tuple(
        Row(
            (card.model,),
            tuple(
                mean
                for name in names
                for mean in (card.families[name].first.mean, card.families[name].refined.mean)
            ),
        )
        for card in cards
    )
    return Table("Shares by family", ("model",), columns, rows)


def tell_fragile(cards: Sequence[Scorecard]) -> bool:
    """Whether any card knows which machines are fragile: those of old versions do not."""
    return any(card.fragile is not None for card in cards)


def _tell_met(cards: Sequence[Scorecard]) -> bool:
    """Whether any card knows how many requirements machines meet."""
    return any(item.refined.met for card in cards for item in card.items)


def _values(item: ItemResult, fragile: bool, met: bool) -> tuple[Value, ...]:
    """What a card says about an item; `fragile`: also whether its best machine is; `met`: how many
    requirements that one meets."""
    told = {True: "yes", False: "no", None: None}[item.refined.fragile]
    kept = Rate(*item.refined.met) if item.refined.met else None
    return (item.first_share, item.refined.share, *[told] * fragile, *[kept] * met)


def _by_item(cards: Sequence[Scorecard]) -> Table:
    met = _tell_met(cards)
    columns = tuple(
        column
        for card in cards
        for column in (
            Column(card.model, "first", percent=True),
            Column(card.model, "refined", percent=True),
            *[Column(card.model, "fragile")] * tell_fragile(cards),
            *[Column(card.model, "met")] * met,
        )
    )
    rows = tuple(
        Row(
            (of[0].item, of[0].family, number(of[0].full)),
            tuple(value for item in of for value in _values(item, tell_fragile(cards), met)),
        )
        for of in zip(*(card.items for card in cards), strict=True)
    )
    return Table("Shares by item", ("item", "family", "full score"), columns, rows)

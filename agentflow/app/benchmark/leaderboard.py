"""Leaderboards: scorecards side by side, ranked by verified scores."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import fmean

from agentflow.app.benchmark.card import FIRST, NAME, ItemResult, Scorecard, read_card
from agentflow.env.tasks.records import other_recorders
from agentflow.errors import RunError, UsageError
from agentflow.metrics.intervals import Rate, missing_scipy
from agentflow.metrics.tables import FORMATS, Column, Row, Table, Value, number

INTERVAL = "95 %"
COSTS = ("calls", "tokens", "money", "rollouts")
OF_RECORDS = (
    "Shares are scores divided by the greatest possible score of the item or, if there is none, "
    "by the record"
)
"""Of cards of the first benchmark."""
OF_PARS = (
    "Shares are 0 % at an item's floor and 100 % at its par, and at most 150 % (floor: what random "
    "machines reach; par: what a long search of the built-in designer, or a known machine, reaches)"
)
ABOUT = (
    "{of}, averaged over items; an invalid machine counts as 0. {parts}Intervals are bootstrap "
    "intervals over items, each with all its seeds."
)
OF_FIRST = "first: plain scores of single replies without feedback. "
OF_OTHERS = "{parts}: verified score of the best machine of a run with feedback. "
OF_AREA = "area: mean share of the best machine so far, by plain score, over all simulations."
OF_FRAGILE = (
    "fragile: number of items whose best machine fails under some small change of masses, "
    "friction, drives or time step."
)


def cards_in(folder: Path) -> list[Path]:
    """Files of cards in a folder, and of those in folders of their own."""
    return [*sorted(folder.glob("*.json")), *sorted(folder.glob(f"*/{NAME}"))]


def comparable(paths: Iterable[Path]) -> list[list[Path]]:
    """Files of cards, those that can be compared together; a copy of a card counts once."""
    files, found = dict[bytes, Path](), dict[object, list[Path]]()
    for path in paths:
        files.setdefault(path.read_bytes(), path)
    for path in files.values():
        card = read_card(path)
        found.setdefault((card.digest, str(card.conditions), *card.parts), []).append(path)
    return list(found.values())


def find_cards(path: Path) -> list[Path]:
    """Files of cards that a path stands for: a folder without one of its own holds several.

    Raises:
        UsageError: They cannot be compared, or there are none.
    """
    if not path.is_dir() or (path / NAME).exists():
        return [path]
    groups = comparable(cards_in(path))
    if len(groups) == 1:
        return groups[0]
    choices = [f"agentflow leaderboard {shlex.join(map(str, group))}" for group in groups]
    several = f"cards of {len(groups)} benchmarks, which cannot be compared: write "
    raise UsageError(f"{path} has {several + ' or '.join(choices) if groups else f'no {NAME}'}")


def read_cards(paths: Sequence[Path]) -> list[Scorecard]:
    """Read cards that can be compared, best first; parts that not all of them have are left out.

    Raises:
        RunError: A file is not a card, is damaged, or was edited.
        UsageError: The cards are of different versions, or have no part in common.
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
    parts = [part for part in first.parts if all(part in card.parts for card in cards)]
    if not parts:
        raise UsageError("the cards have no part in common: make them with the same --part")
    cards = [card.only(parts) for card in cards]
    return sorted(
        cards, key=lambda card: (not card.complete, -(card.total[card.ranked].mean or 0.0))
    )


def _contents(card: Scorecard) -> tuple[list[str], list[str]]:
    return list(card.families), [item.item for item in card.items]


def leaderboard(cards: Sequence[Scorecard], checked: Sequence[str] = ()) -> tuple[Table, ...]:
    """Three tables: all cards ranked, with what `check_cards` found; by family, and by item."""
    return _ranking(cards, checked), _by_family(cards), _by_item(cards)


def format_tables(tables: Sequence[Table], form: str) -> str:
    """Tables one after the other, in one of the `FORMATS`; JSON is one object per line."""
    return ("" if form == "json" else "\n").join(FORMATS[form](table) for table in tables)


def shown_parts(card: Scorecard) -> list[str]:
    """The parts of a card, the one that ranks first."""
    return sorted(card.parts, key=lambda part: part != card.ranked)


def _ranking(cards: Sequence[Scorecard], checked: Sequence[str]) -> Table:
    first, fragile = cards[0], tell_fragile(cards)
    parts = shown_parts(first)
    areas = [part for part in parts if any(_area(card, part) is not None for card in cards)]
    seeds = any(card.seeds > 1 for card in cards)
    columns = [
        Column(part, name, percent=True, digits=digits)
        for part in parts
        for name, digits in (("share", 2), (INTERVAL, 1))
    ]
    columns[2:2] = [Column(first.ranked, "fragile")] * fragile
    columns += [Column(part, "area", percent=True) for part in areas]
    columns += [Column("", name) for name in ["seeds"] * seeds + [*COSTS]]
    rows = []
    for place, card in enumerate(cards, start=1):
        cost, total = card.cost, card.total
        values: list[Value] = []
        for part in parts:
            values += [total[part].mean, total[part].interval]
        values[2:2] = [card.fragile] * fragile
        values += [_area(card, part) for part in areas]
        values += [card.seeds] * seeds
        values += [cost.calls, cost.prompt_tokens + cost.completion_tokens]
        values += [cost.money, cost.rollouts]
        rows.append(Row((str(place) if card.complete else "-", card.model), tuple(values)))
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
    pars = "pars" in conditions
    others = "" if pars else other_recorders([engine])
    of_records = f"The records were simulated by {others}." if others else ""
    runs = ", ".join(part for part in parts if part != FIRST)
    told = OF_OTHERS.format(parts=runs) * bool(runs) + OF_FIRST * (FIRST in parts)
    about = (
        ABOUT.format(of=OF_PARS if pars else OF_RECORDS, parts=told),
        f"Cards are ranked by {first.ranked}.",
        *[OF_FRAGILE] * fragile,
        *[OF_AREA] * bool(areas),
    )
    notes = (*checked, *loose, *incomplete, *about, *filter(None, [of_records, missing_scipy()]))
    return Table(title, ("rank", "model"), tuple(columns), tuple(rows), notes=notes)


def _area(card: Scorecard, part: str) -> float | None:
    known = [area for item in card.items if (area := item.area(part)) is not None]
    return fmean(known) if known else None


def _by_family(cards: Sequence[Scorecard]) -> Table:
    places = [(name, part) for name in cards[0].families for part in cards[0].parts]
    columns = tuple(Column(name, part, percent=True) for name, part in places)
    rows = tuple(
        Row((card.model,), tuple(card.families[name][part].mean for name, part in places))
        for card in cards
    )
    return Table("Shares by family", ("model",), columns, rows)


def tell_fragile(cards: Sequence[Scorecard]) -> bool:
    """Whether any card knows which machines are fragile: those of old versions do not."""
    return any(card.fragile is not None for card in cards)


def _met(item: ItemResult, part: str) -> Rate | None:
    """How many requirements the best machines of all seeds meet; None without any."""
    found = sum((Rate(*one.met) for one in item.parts[part] if one.met), Rate(0, 0))
    return found if found.of else None


def _tell_met(cards: Sequence[Scorecard]) -> bool:
    """Whether any card knows how many requirements machines meet."""
    return any(one.met for card in cards for item in card.items for one in item.parts[card.ranked])


def _values(item: ItemResult, part: str, fragile: bool, met: bool) -> tuple[Value, ...]:
    """What a card says about an item; `fragile`: also whether a best machine of `part` is; `met`:
    how many requirements these meet."""
    known = [one.fragile for one in item.parts[part] if one.fragile is not None]
    told = ("yes" if any(known) else "no") if known else None
    shares = (item.share(name) for name in item.parts)
    return (*shares, *[told] * fragile, *[_met(item, part)] * met)


def _by_item(cards: Sequence[Scorecard]) -> Table:
    fragile, met, ranked = tell_fragile(cards), _tell_met(cards), cards[0].ranked
    columns = tuple(
        column
        for card in cards
        for column in (
            *(Column(card.model, part, percent=True) for part in card.parts),
            *[Column(card.model, "fragile")] * fragile,
            *[Column(card.model, "met")] * met,
        )
    )
    rows = tuple(
        Row(
            (of[0].item, of[0].family, number(of[0].full)),
            tuple(value for item in of for value in _values(item, ranked, fragile, met)),
        )
        for of in zip(*(card.items for card in cards), strict=True)
    )
    return Table("Shares by item", ("item", "family", "full score"), columns, rows)

"""Reference machines: each level has one that solves it, and it still scores what its file says."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest
from PIL import Image

from agentflow.env import tasks
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import FAMILIES, get_level, get_task, task_names
from benchmarks.shelf import (
    DIGITS,
    FOLDER,
    IDLE,
    Reference,
    families,
    here,
    load,
    machine_records,
    read,
)
from tests.loops import for_each

LEVELS = Path(tasks.__file__).parent / "levels"
ALL = tuple((shelf.platform, item) for shelf in map(read, families()) for item in shelf.references)
SHARE = 1 / 3
"""Share of the good score that a reference machine reaches."""
ELSEWHERE = 0.05
"""How far a score may be off on another platform."""
PICTURE = 25_000
"""Bytes."""


RECORDS = {
    (get_task(record.task).name, record.machine.digest): record.score
    for record in machine_records().values()
    if not record.knobs
}
"""Scores of the best known machine of each level, which test_records.py simulates."""


def score(item: Reference, power: bool) -> float:
    result = simulate(load(item.machine), get_task(item.level), power=power)
    assert result.status == "ok", result.problems
    assert result.score is not None
    return round(result.score, DIGITS)


def recorded(item: Reference) -> float | None:
    return RECORDS.get((item.level, load(item.machine).digest))


def name(case: tuple[str, Reference]) -> str:
    return case[1].machine


@for_each(item for _, item in ALL)
def test_a_reference_that_is_a_record_has_its_score(item: Reference) -> None:
    assert recorded(item) in (None, pytest.approx(item.score, abs=10.0**-DIGITS))


@pytest.mark.slow
@pytest.mark.parametrize("case", [case for case in ALL if recorded(case[1]) is None], ids=name)
def test_every_reference_keeps_its_score(case: tuple[str, Reference]) -> None:
    where, item = case
    found = score(item, True)
    if where == here():
        assert found == item.score
    else:
        assert found == pytest.approx(item.score, rel=ELSEWHERE)


def spread() -> list[tuple[str, Reference]]:
    """One of each family, each at another of the five levels.

    `benchmarks/references.py --check` tries all of them.
    """
    shelves = [[case for case in ALL if get_task(case[1].level).family == f] for f in families()]
    return [cases[number % len(cases)] for number, cases in enumerate(shelves)]


@pytest.mark.slow
@pytest.mark.parametrize("case", spread(), ids=name)
def test_no_reference_earns_anything_without_power(case: tuple[str, Reference]) -> None:
    _, item = case
    assert score(item, False) <= IDLE * get_level(item.level).file.good


@for_each(task_names())
def test_every_level_has_a_reference_that_reaches_a_third_of_what_is_good(level: str) -> None:
    good = get_level(level).file.good
    assert max((item.score for _, item in ALL if item.level == level), default=0.0) >= SHARE * good


def test_almost_all_levels_are_solved_as_intended() -> None:
    """For all but four."""
    honest = {item.level for _, item in ALL if item.intended}
    assert len(set(task_names()) - honest) <= 4


def test_comments_on_good_scores_follow_the_reference_machines() -> None:
    """Records change, so no comment names them."""
    compared = 0
    for path in sorted(LEVELS.glob("*.yaml")):
        family, _, number = path.stem.rpartition("-")
        level = family if number == "1" else f"{family}/{number}"
        [comment] = re.findall(r"(?m)^good: .*?#(.*)$", path.read_text(encoding="utf-8"))
        assert not re.search(r"\b(best known|record)\b", comment), path.name
        told = re.search(r"machine (?:carries|reaches|throws) ([\d.]+)", comment)
        if told:
            best = max(item.score for item in read(family).references if item.level == level)
            assert float(told[1]) == pytest.approx(best, rel=0.03), path.name
            compared += 1
    assert compared >= 9


@for_each(item for _, item in ALL)
def test_every_reference_says_how_it_was_found_and_has_a_small_picture(item: Reference) -> None:
    path = FOLDER / item.picture
    assert item.how.startswith(("by hand", "search: "))
    assert path.stat().st_size < PICTURE
    with Image.open(path) as picture:
        assert picture.size == (480, 360)
        assert picture.mode == "P"


def test_the_files_are_those_of_the_families() -> None:
    assert set(families()) <= set(FAMILIES)
    assert [read(family).family for family in families()] == list(families())
    stray = Counter(
        path.relative_to(FOLDER).as_posix()
        for path in FOLDER.glob("*/*.json")
        if path.parent.name != "common"
    )
    used = {item.machine for _, item in ALL}
    used |= {cheat.machine for family in families() for cheat in read(family).cheats}
    assert set(stray) <= used

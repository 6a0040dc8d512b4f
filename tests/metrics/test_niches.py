"""Numbers of archives, on made-up events."""

from __future__ import annotations

from agentflow.metrics.niches import Elites, best_by_class
from agentflow.runs.events import ArchiveEvent, NicheEvent, RecordedAxis
from agentflow.runs.locations import FEEDBACK, Location

AXES = (
    RecordedAxis("wheels", "", 0.0, 4.0, 4, ()),
    RecordedAxis("drive", "", -0.5, 1.5, 2, ("springs", "motors")),
)


def niche(
    trajectory: int,
    node: int,
    cell: tuple[int, int] | None,
    score: float | None,
    mechanism: str | None = "springs / container / arm",
) -> NicheEvent:
    location = Location(FEEDBACK, trajectory=trajectory, node=node)
    name = f"m{trajectory}{node}"
    return NicheEvent(location, 1, name, score, (0.0, 0.0), cell, "new", mechanism)


EVENTS = (
    ArchiveEvent(Location(FEEDBACK, trajectory=1), AXES),
    niche(1, 0, (0, 0), 2.0),
    niche(1, 1, (3, 1), 4.0, "wheels / driven wheels / nothing"),
    niche(1, 2, None, None),
    ArchiveEvent(Location(FEEDBACK, trajectory=2), AXES),
    niche(2, 0, (0, 0), 5.0),
    niche(2, 1, (3, 1), 4.0, "wheels / driven wheels / nothing"),
    niche(2, 2, (1, 0), 1.0, None),
)


def test_archives_of_several_searches_are_merged_by_cell() -> None:
    found = Elites.of(EVENTS)
    assert found is not None
    assert {cell: event.machine for cell, event in found.cells.items()} == {
        (0, 0): "m20",
        (1, 0): "m22",
        (3, 1): "m11",
    }
    assert list(found.cells) == sorted(found.cells)
    assert (found.size, found.coverage) == (8, 3 / 8)
    assert found.qd_score == 10.0


def test_the_order_of_searches_makes_no_difference() -> None:
    assert Elites.of(EVENTS) == Elites.of(reversed(EVENTS))


def test_without_an_archive_there_is_nothing() -> None:
    assert Elites.of(()) is None
    empty = Elites.of(EVENTS[:1])
    assert empty is not None
    assert (empty.coverage, empty.qd_score) == (0.0, 0.0)


def test_classes_are_told_by_their_best_machine() -> None:
    niches = [event for event in EVENTS if isinstance(event, NicheEvent)]
    found = best_by_class(niches)
    assert [(name, event.machine) for name, event in found.items()] == [
        ("springs / container / arm", "m20"),
        ("wheels / driven wheels / nothing", "m11"),
    ]

"""Lays the results of a diagnosis out as a table, with published values if there are any."""

from collections.abc import Mapping, Sequence
from typing import Any

from agentflow.app.diagnose.geometry import CLOSE, Overlap
from agentflow.app.diagnose.outcome import ALL, STAND, TESTS
from agentflow.app.diagnose.question import Diagnosis
from agentflow.errors import UsageError
from agentflow.metrics import published as literature
from agentflow.metrics.intervals import Interval
from agentflow.metrics.tables import Column, Row, Table

TABLE = "overlap_qa"
INTERVAL = "95 %"
DIGITS = 3


def require_published(name: str) -> None:
    """Refuse a diagnostic of which nothing is published.

    Raises:
        UsageError: It is not `overlap`.
    """
    if name != Overlap.name:
        raise UsageError(
            f"only the diagnostic {Overlap.name} has published values, not {name}: leave out "
            "--published"
        )


def published_accuracies() -> dict[str, float]:
    """Model -> published share of overlapping pairs that it found."""
    return {i.model: float(i.value) for i in literature.published() if i.table == TABLE}


def table_of(found: Diagnosis, *, published: bool) -> Table:
    """The results of a finished diagnosis, with published rows if `published`."""
    results = found.results or {}
    names, rows, note = _LAYOUTS[found.diagnostic](results)
    known = published_accuracies() if published else {}
    empty = (None,) * (len(names) - 1)
    return Table(
        f"{found.diagnostic}, {found.model}, seed {found.seed}",
        ("model" if found.diagnostic == Overlap.name else "question",),
        tuple(Column("", name, digits=DIGITS) for name in names),
        tuple(Row((label or found.model,), values) for label, values in rows),
        tuple(Row((model,), (share, *empty)) for model, share in known.items()),
        (note, *_notes(results)),
    )


Layout = tuple[tuple[str, ...], list[tuple[str, tuple[Any, ...]]], str]
"""Headings; label (the model's name if empty) and values of each row; a note."""


def _overlap(results: Mapping[str, Any]) -> Layout:
    values = (
        results["accuracy"],
        _interval(results["interval"]),
        results["precision"],
        results["f1"],
        results["pairs"],
    )
    about = (
        "Accuracy: found pairs / true pairs; a reply that lists every pair has an accuracy of 1. "
        "Precision: found pairs / named pairs. F1: their harmonic mean."
    )
    return ("accuracy", INTERVAL, "precision", "F1", "pairs"), [("", values)], about


def _facing(results: Mapping[str, Any]) -> Layout:
    rows = [(name, _share(results[name])) for name in ("facing", "centre")]
    about = f"A centre is right if it is at most {CLOSE:g} m off along each axis."
    return ("right", INTERVAL, "blocks"), rows, about


def _outcome(results: Mapping[str, Any]) -> Layout:
    rows = [
        (verb, (*_share(own["right"]), own["yes"]["share"], own["said_yes"]["share"]))
        for verb in (STAND, *TESTS, ALL)
        for own in [results[verb]]
    ]
    about = "Yes: share of machines that do it. It is half, so a guess is right half the time."
    return ("right", INTERVAL, "machines", "yes", "said yes"), rows, about


_LAYOUTS = {"overlap": _overlap, "facing": _facing, "outcome": _outcome}


def _share(rate: Mapping[str, Any]) -> tuple[Any, ...]:
    """Share, interval, and of how many."""
    return rate["share"], _interval(rate["interval"]), rate["of"]


def _interval(ends: Sequence[float] | None) -> Interval | None:
    return Interval(*ends) if ends else None


def _notes(results: Mapping[str, Any]) -> list[str]:
    notes = [f"Questions: {results['questions']}."]
    if results["unreadable"]:
        notes.append(f"Replies without an answer, which count as wrong: {results['unreadable']}.")
    if results.get("faults"):
        notes.append(
            f"Machines left out because their simulation crashed or timed out: {results['faults']}."
        )
    return notes

"""Lays the results of a diagnosis out as a table, with published values if there are any."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from agentflow.app.diagnose.facing import CLOSE
from agentflow.app.diagnose.fate import STAND, TESTS
from agentflow.app.diagnose.overlap import Overlap
from agentflow.app.diagnose.record import Diagnosis
from agentflow.errors import UsageError
from agentflow.metrics import published as literature
from agentflow.metrics.tables import Column, Row, Table, cell_text, text

TABLE = "overlap_qa"
"""Name of the published table."""
INTERVAL = "95 %"


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


def format_results(found: Diagnosis, *, published: bool) -> str:
    """The results of a finished diagnosis as a table in plain text."""
    return text(_table(found, published=published))


def _table(found: Diagnosis, *, published: bool) -> Table:
    results = found.results or {}
    columns, rows, note = _LAYOUTS[found.diagnostic](results)
    known = published_accuracies() if published else {}
    empty = (None,) * (len(columns) - 1)
    return Table(
        f"{found.diagnostic}, {found.model}, seed {found.seed}",
        ("model" if found.diagnostic == Overlap.name else "question",),
        columns,
        tuple(Row((label or found.model,), values) for label, values in rows),
        tuple(Row((model,), (share, *empty)) for model, share in known.items()),
        (note, *_notes(results)),
    )


Layout = tuple[tuple[Column, ...], list[tuple[str, tuple[Any, ...]]], str]


def _overlap(results: Mapping[str, Any]) -> Layout:
    columns = tuple(
        Column("", name, digits=3) for name in ("accuracy", INTERVAL, "precision", "F1", "pairs")
    )
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
    return columns, [("", values)], about


def _facing(results: Mapping[str, Any]) -> Layout:
    columns = tuple(Column("", name, digits=3) for name in ("right", INTERVAL, "blocks"))
    rows = [
        (name, (own["share"], _interval(own["interval"]), own["of"]))
        for name in ("facing", "centre")
        for own in [results[name]]
    ]
    about = f"A centre is right if it is at most {CLOSE:g} m off along each axis."
    return columns, rows, about


def _fate(results: Mapping[str, Any]) -> Layout:
    names = ("right", INTERVAL, "yes", "recall", "precision", "F1", "machines")
    columns = tuple(Column("", name, digits=3) for name in names)
    rows = [
        (
            verb,
            (
                own["right"]["share"],
                _interval(own["right"]["interval"]),
                own["yes"]["share"],
                own["recall"],
                own["precision"],
                own["f1"],
                own["right"]["of"],
            ),
        )
        for verb in (STAND, *TESTS)
        for own in [results[verb]]
    ]
    return columns, rows, "Yes: share of machines that do it in the simulation."


_LAYOUTS = {"overlap": _overlap, "facing": _facing, "fate": _fate}


def _notes(results: Mapping[str, Any]) -> list[str]:
    notes = [f"Questions: {results['questions']}."]
    if results["unreadable"]:
        notes.append(f"Replies without an answer, which count as wrong: {results['unreadable']}.")
    if results.get("faults"):
        notes.append(
            f"Machines left out because their simulation crashed or timed out: {results['faults']}."
        )
    return notes


def _interval(ends: tuple[float, float] | None) -> str | None:
    return ends and " - ".join(cell_text(end, digits=3) for end in ends)

"""The nodes of a run's tree."""

from __future__ import annotations

from dataclasses import dataclass

REFUSED, INVALID = "refused", "invalid"


@dataclass(frozen=True)
class LineageNode:
    """A node of the tree."""

    id: str
    parent: str | None
    title: str
    kind: str
    """Stage of the machine; `refused` for a refused edit, `invalid` for no machine."""
    machine: str | None = None
    """Content hash."""
    score: float | None = None
    valid: bool = False
    status: str = ""
    broken: bool = False
    edit: str = ""
    problem: str = ""
    calls: tuple[str, ...] = ()
    """Labels of the calls that made it."""
    best: bool = False
    """Whether it is the run's result."""
    lead: bool = False
    """Whether it is the result or one of its ancestors."""

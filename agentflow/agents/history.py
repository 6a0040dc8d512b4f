"""Owns the edit history that a refiner is shown: what was tried, and what became of the score.

Spec 5.3: the command, its verdict and reason, the score before and after; nothing of prompts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

LIMIT = 20
"""Most entries kept (spec 5.3)."""
MAX_LINES = 20
"""Most lines shown of one script or reason."""
MAX_WIDTH = 300
"""Most characters shown of a line."""
SHORT_LIMIT, SHORT_LINES, SHORT_WIDTH = 4, 3, 100
"""The same three where few tokens are to be had."""


@dataclass(frozen=True)
class EditRecord:
    """One earlier modification of the machine or of one of its ancestors."""

    script: str
    """Its commands, or a description where a whole machine was sent."""
    verdict: str
    """`Success` or `Error`."""
    reason: str = ""
    """Why it failed; the verdicts step by step."""
    before: float | None = None
    """Score of the machine that it was applied to; None where there is none."""
    after: float | None = None
    """Score of the machine that it gave; None where there is none."""
    number: int = 0
    """Counts from 1 in order of time; set when it enters a history."""


@dataclass(frozen=True)
class History:
    """Entries in order of time. Bounded: the newest stay, and always the best and the worst."""

    entries: tuple[EditRecord, ...] = ()
    limit: int = LIMIT
    """At least 3: the best, the worst and the newest."""

    def __post_init__(self) -> None:
        if self.limit < 3:
            raise ValueError(f"a history needs a limit of at least 3, not {self.limit}")

    def add(self, entry: EditRecord) -> History:
        """The history with one more entry, the oldest dispensable one gone if it is too long."""
        number = self.entries[-1].number + 1 if self.entries else 1
        entries = (*self.entries, replace(entry, number=number))
        return replace(self, entries=_bounded(entries, self.limit))

    def to_text(self) -> str:
        """One paragraph per entry, oldest first; "" for an empty history."""
        return _text(self.entries, MAX_LINES, MAX_WIDTH)

    def to_short_text(self) -> str:
        """The same of the best, the worst and the newest entries only, and less of each."""
        return _text(_bounded(self.entries, SHORT_LIMIT), SHORT_LINES, SHORT_WIDTH)


def _bounded(entries: tuple[EditRecord, ...], limit: int) -> tuple[EditRecord, ...]:
    """As many entries, the oldest gone first, the best and the worst never."""
    kept = {item.number for item in _extremes(entries)}
    gone = [item.number for item in entries if item.number not in kept]
    gone = gone[: max(0, len(entries) - limit)]
    return tuple(item for item in entries if item.number not in gone)


def _text(entries: tuple[EditRecord, ...], lines: int, width: int) -> str:
    best, worst = _marks(entries)
    return "\n".join(_entry_text(item, best, worst, lines, width) for item in entries)


def _extremes(entries: tuple[EditRecord, ...]) -> tuple[EditRecord, ...]:
    """The entries with the greatest and the least score after; the earlier one among equals."""
    scored = [item for item in entries if item.after is not None]
    if not scored:
        return ()
    return max(scored, key=_after), min(scored, key=_after)


def _after(entry: EditRecord) -> float:
    return entry.after if entry.after is not None else 0.0


def _marks(entries: tuple[EditRecord, ...]) -> tuple[int, int]:
    """Numbers of the best and the worst entry; 0 where the scores tell none apart."""
    extremes = _extremes(entries)
    if not extremes or _after(extremes[0]) == _after(extremes[1]):
        return 0, 0
    return extremes[0].number, extremes[1].number


def _entry_text(entry: EditRecord, best: int, worst: int, lines: int, width: int) -> str:
    mark = {best: ", best so far", worst: ", worst so far"}.get(entry.number, "")
    head = f"{entry.number}. {entry.verdict}, score {_score(entry.before)} -> {_score(entry.after)}"
    told = (line for text in (entry.script, entry.reason) for line in _cut(text, lines, width))
    return "\n".join([head + mark, *told])


def _cut(text: str, most: int, width: int) -> list[str]:
    """The first lines of a text and of each the first characters, indented."""
    lines = text.strip().splitlines()
    shown = [f"   {line.strip()[:width]}" for line in lines[:most]]
    return [*shown, "   ..."] if len(lines) > most else shown


def _score(score: float | None) -> str:
    return "none" if score is None else f"{score:.2f}"

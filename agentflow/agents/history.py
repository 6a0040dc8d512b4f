"""The edit history in a refiner's prompt: earlier edits with verdicts and scores."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from agentflow.machine.edits.commands import TELLING, command_text, read_command
from agentflow.machine.edits.difference import Renumbering, follow, renumber

LIMIT = 20
"""Most entries that a history keeps."""
MAX_LINES = 20
"""Maximum number of lines shown of a script or reason."""
MAX_WIDTH = 300
"""Maximum number of characters shown of a line."""
SHORT_LIMIT, SHORT_LINES, SHORT_WIDTH = 4, 3, 100
"""The same three limits for the short text, which saves tokens."""
_VERDICT = re.compile(r"(.+): (Success|Error|Unverified)(?: \((\w+): .*\))?")
_BLOCK = re.compile(r"\bblock (\d+)( \([^()]*\))?")


@dataclass(frozen=True)
class EditRecord:
    """One earlier edit of the machine or of one of its ancestors."""

    script: str
    """Its commands, or a description if a whole machine was sent."""
    verdict: str
    """`Success` or `Error`."""
    reason: str = ""
    """Why it failed: the verdict on each step."""
    before: float | None = None
    """Score of the machine that was edited; None without a score."""
    after: float | None = None
    """Score of the resulting machine; None without a score."""
    facts: tuple[Mapping[str, str], Mapping[str, str]] = ({}, {})
    """What else the simulations of both machines showed: name -> value."""
    ids: Renumbering = field(default_factory=dict)
    """Ids that it uses -> those of the current machine; empty if they are the same."""
    number: int = 0
    """Position in time, from 1; set when it is added to a history."""


@dataclass(frozen=True)
class History:
    """Edits in order of time. If there are too many, the newest, best and worst are kept."""

    entries: tuple[EditRecord, ...] = ()

    def add(self, entry: EditRecord) -> History:
        """The history with one more entry; the oldest is dropped if there are too many."""
        number = self.entries[-1].number + 1 if self.entries else 1
        return History(_limit((*self.entries, replace(entry, number=number)), LIMIT))

    def renumbered(self, ids: Renumbering) -> History:
        """The history in the numbering after a further edit."""
        return History(tuple(replace(it, ids=follow(it.ids, ids)) for it in self.entries))

    def to_text(self) -> str:
        """One paragraph per entry, oldest first; "" if empty."""
        return _text(self.entries, MAX_LINES, MAX_WIDTH)

    def to_short_text(self) -> str:
        """The same, shortened, for the best, the worst and the newest entries only."""
        return _text(_limit(self.entries, SHORT_LIMIT), SHORT_LINES, SHORT_WIDTH)


def _limit(entries: tuple[EditRecord, ...], limit: int) -> tuple[EditRecord, ...]:
    """At most `limit` entries: the oldest are dropped first, the best and the worst never."""
    kept = {item.number for item in _extremes(entries)}
    gone = [item.number for item in entries if item.number not in kept]
    gone = gone[: max(0, len(entries) - limit)]
    return tuple(item for item in entries if item.number not in gone)


def _text(entries: tuple[EditRecord, ...], lines: int, width: int) -> str:
    best, worst = _marks(entries)
    return "\n".join(_entry_text(item, best, worst, lines, width) for item in entries)


def _extremes(entries: tuple[EditRecord, ...]) -> tuple[EditRecord, ...]:
    """The entries with the highest and the lowest resulting score; the earlier one if tied."""
    scored = [item for item in entries if item.after is not None]
    if not scored:
        return ()
    return max(scored, key=_after), min(scored, key=_after)


def _after(entry: EditRecord) -> float:
    return entry.after if entry.after is not None else 0.0


def _marks(entries: tuple[EditRecord, ...]) -> tuple[int, int]:
    """Numbers of the best and the worst entry; 0 and 0 if all scores are equal."""
    extremes = _extremes(entries)
    if not extremes or _after(extremes[0]) == _after(extremes[1]):
        return 0, 0
    return extremes[0].number, extremes[1].number


def _entry_text(entry: EditRecord, best: int, worst: int, lines: int, width: int) -> str:
    mark = {best: ", best so far", worst: ", worst so far"}.get(entry.number, "")
    head = f"{entry.number}. {entry.verdict}, score {_score(entry.before)} -> {_score(entry.after)}"
    told = (_renumbered(text, entry.ids) for text in (entry.script, entry.reason))
    body = (line for text in told for line in _cut(text, lines, width))
    return "\n".join(["; ".join([head + mark, *_changes(*entry.facts)]), *body])


def _changes(before: Mapping[str, str], after: Mapping[str, str]) -> list[str]:
    """The facts that differ."""
    return [
        f"{name} {before.get(name, 'none')} -> {after.get(name, 'none')}"
        for name in {**before, **after}
        if before.get(name) != after.get(name)
    ]


def _renumbered(text: str, ids: Renumbering) -> list[str]:
    """The lines of a script, or of the verdicts on it, in the numbering of the current machine."""
    lines = text.strip().splitlines()
    return [_renumbered_line(line.strip(), ids) for line in lines] if ids else lines


def _renumbered_line(line: str, ids: Renumbering) -> str:
    """A line; of the reason of an error, only the code stays, as it was about other ids."""
    verdict = _VERDICT.fullmatch(line)
    command = read_command(verdict[1] if verdict else line)
    if command is None:
        return _renumbered_blocks(line, ids)
    words = "".join(map(str, renumber(command_text(command), ids)))
    if verdict is None:
        changed = line.partition("//")[2] if isinstance(command, TELLING) else ""
        return words + (f"  //{_renumbered_blocks(changed, ids)}" if changed else "")
    return f"{words}: {verdict[2]}" + (f" ({verdict[3]})" if verdict[3] else "")


def _renumbered_blocks(text: str, ids: Renumbering) -> str:
    """A sentence that calls blocks `block 3` or `block 3 (Log)`."""
    return _BLOCK.sub(lambda found: _label(int(found[1]), found[2] or "", ids), text)


def _label(block: int, name: str, ids: Renumbering) -> str:
    text = ids.get(block, (block,))
    words = "".join(map(str, text))
    return f"block {words}{name}" if isinstance(text[0], int) else words


def _cut(lines: list[str], most: int, width: int) -> list[str]:
    """The first `most` lines, each cut to `width` characters and indented."""
    shown = [f"   {line.strip()[:width]}" for line in lines[:most]]
    return [*shown, "   ..."] if len(lines) > most else shown


def _score(score: float | None) -> str:
    return "none" if score is None else f"{score:.2f}"

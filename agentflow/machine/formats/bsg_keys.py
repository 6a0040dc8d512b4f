"""Keys of the game Besiege in place of a control program, which its machine files cannot hold."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from agentflow.machine.controls import Lane, lanes
from agentflow.machine.problems import comma_list
from agentflow.machine.tree import Machine, shorten

KEYS = tuple(
    [f"Alpha{digit}" for digit in (*range(1, 10), 0)]
    + [f"Keypad{digit}" for digit in range(10)]
    + [chr(code) for code in range(ord("A"), ord("Z") + 1)]
)
"""Names of keys, as Unity calls them, in the order in which they are used."""
NO_KEY = "None"

Spans = tuple[tuple[float, float], ...]
"""From when to when a key is held, s."""


@dataclass(frozen=True)
class Binding:
    """The keys of blocks that the program drives alike."""

    blocks: tuple[int, ...]
    keys: tuple[str, str]
    """For levels above 0 and below; of grabbers, the second one opens them. `NO_KEY` for none."""
    held: tuple[Spans, Spans]
    """When each is held."""

    def __str__(self) -> str:
        """What a player does."""
        held = "; ".join(
            f"{key} from {' and from '.join(map(_span_text, spans))}"
            for key, spans in zip(self.keys, self.held, strict=True)
            if spans
        )
        noun = "block" if len(self.blocks) == 1 else "blocks"
        return f"the game has no control programs: for {noun} {comma_list(self.blocks)} hold {held}"


def bind_keys(machine: Machine) -> tuple[Binding, ...]:
    """A binding for each lane of the program; without a key once all are used."""
    left = iter(KEYS)
    found = []
    for lane in lanes(machine):
        first, second = held = _held(lane)
        keys = next(left, NO_KEY) if first else NO_KEY, next(left, NO_KEY) if second else NO_KEY
        found.append(Binding(lane.blocks, keys, held))
    return tuple(found)


def _held(lane: Lane) -> tuple[Spans, Spans]:
    """When the first and the second key of a lane are held; grabbers have only the second."""
    if lane.rest:
        return (), _merged((begin, end) for begin, end, level in lane.spans if level <= 0.0)
    forward = _merged((begin, end) for begin, end, level in lane.spans if level > 0.0)
    return forward, _merged((begin, end) for begin, end, level in lane.spans if level < 0.0)


def _merged(spans: Iterable[tuple[float, float]]) -> Spans:
    """Spans in order of time, those that follow each other without a break as one."""
    merged: list[tuple[float, float]] = []
    for begin, end in spans:
        if merged and merged[-1][1] == begin:
            begin = merged.pop()[0]
        merged.append((begin, end))
    return tuple(merged)


def _span_text(span: tuple[float, float]) -> str:
    begin, end = map(shorten, span)
    return f"{begin} to {end} s"

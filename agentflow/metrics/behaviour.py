"""How a designer behaves in a run, also with tools: its edits, what it predicted of them, and what
came of them.

Fixed rules on its words say what it predicts: success or not, and a score.
"""

from __future__ import annotations

import re
import statistics
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from agentflow.metrics.intervals import Rate
from agentflow.metrics.search import search_roots
from agentflow.runs.events import AttemptEvent, EvaluationEvent, RunEvent, ToolEvent
from agentflow.runs.locations import FEEDBACK, INITIAL, Location
from agentflow.runs.reading import Event
from agentflow.runs.record import RunRecord

SUCCESS = (
    *("achieve", "clear", "complete", "farther", "higher", "hold", "improve", "increase"),
    *("pass", "solve", "stable", "succeed", "success", "successful"),
)
"""Words of success; ours, as no list is published. Forms in -s, -es, -d, -ed and -ing count."""
DENIALS = r"(?:not|never|no|nothing|without|fails? to|unlikely|cannot|hardly)"
"""Words that deny a word of success within the three words after them."""

_SUCCESS = re.compile(rf"\b(?:{'|'.join(SUCCESS)})(?:e?[sd]|ing)?\b", re.IGNORECASE)
_DENIED = re.compile(rf"\b{DENIALS}(?:\s+[\w-]+){{0,2}}\s+$", re.IGNORECASE)

_NUMBER = r"-?\d+(?:\.\d+)?"
_RANGE = rf"({_NUMBER})(?:\s*(?:-|to|or)\s*({_NUMBER}))?(?![\d.]*\d|\s*(?:%|per\s?cent))"
_WORDS = "at|about|around|roughly|nearly|some|of|is|be|to|least|than|more|again"
_FILLER = rf"(?:\s*(?:[=:]|(?:{_WORDS})\b))*"
_POINTS = (
    re.compile(rf"\bscore[sd]?{_FILLER}\s*{_RANGE}", re.IGNORECASE),
    re.compile(rf"{_RANGE}\s+points?\b", re.IGNORECASE),
)
_METRES = (
    re.compile(
        rf"\b(?:distance|throw|lands?){_FILLER}\s*{_RANGE}\s*m\b(?!\s+behind)", re.IGNORECASE
    ),
    re.compile(rf"{_RANGE}\s*m(?:etres)?\s+(?:away|in\s+{_NUMBER}\s*s)\b", re.IGNORECASE),
)


def predicts_success(prediction: str) -> bool:
    """Whether a prediction has a word of success that is not denied just before it."""
    return any(
        not _DENIED.search(prediction[: found.start()]) for found in _SUCCESS.finditer(prediction)
    )


def predicted_score(prediction: str, *, metres: bool) -> float | None:
    """The score that a prediction names, the middle of a range; None if it names none.

    It is the number after "score", or before "points". Where the score is a distance, it is also
    the number of metres after "distance", "throw" or "lands" (not "lands 7 m behind it"), or before
    "away" or "in 20 s". The first that is found counts, in this order.

    Args:
        prediction: The refiner's words.
        metres: Whether the score of the task is a distance.
    """
    for pattern in (*_POINTS, *(_METRES if metres else ())):
        if found := pattern.search(prediction):
            ends = [float(end) for end in found.groups() if end]
            return sum(ends) / len(ends)
    return None


MARGIN = 0.02
"""Relative loss of score that is not yet a failure; chosen, as that of variations of physics."""

NONE = Rate(0, 0)


@dataclass(frozen=True)
class Edit:
    """An accepted edit whose machine was simulated; both results have scores.

    `replies` are to the calls in which its author may have predicted its result; a random edit has
    none. `informed` says whether its author had seen how the previous machine did in the
    simulation.
    """

    replies: tuple[Location, ...]
    before: EvaluationEvent
    after: EvaluationEvent
    informed: bool

    @property
    def failed(self) -> bool:
        """Whether the edited machine fails, or scores over 2 % less than the one before."""
        return fails(self.after) or _score(self.after) < (1 - MARGIN) * _score(self.before)


def fails(result: EvaluationEvent) -> bool:
    """Whether a simulated machine does not do its task at all: it is invalid, or scores 0."""
    return not result.valid or _score(result) <= 0


def edits(record: RunRecord) -> Iterator[Edit]:
    """The edits of a run in the order of replies, those by refiners before random ones.

    Edits are left out if a simulation of one of their machines crashed or timed out, if the
    machine was never simulated because the run ended, and if they changed nothing.
    """
    # (trajectory, node) -> machine; the node of first machines is None
    machines: dict[tuple[int, int | None], str | None] = {
        **{(start.trajectory, None): start.machine for start in record.of_stage(INITIAL)},
        **{(number, 0): start.machine for number, start in search_roots(record).items()},
        **{(n.location.trajectory, n.location.node): n.machine for n in record.nodes},
    }
    made: list[tuple[tuple[Location, ...], str | None, str | None]] = []
    for item in record.refinements:
        place = item.location
        made.append(((place,), machines.get((place.trajectory, place.node)), item.machine))
    made += [((), edit.parent, edit.machine) for edit in record.edits]
    for replies, parent, machine in made:
        before, after = record.machines.get(parent or ""), record.machines.get(machine or "")
        if before and after and parent != machine and None not in (before.score, after.score):
            of_feedback = any(place.node is not None for place in replies)
            yield Edit(replies, before, after, informed=of_feedback)


class Change(Protocol):
    """What is known of the difference of two machines, each given by its content hash."""

    def keeps_mechanism(self, before: str, after: str) -> bool:
        """Whether both work by the same kinds of moving blocks."""

    def size(self, before: str, after: str) -> float:
        """Their tree edit distance, blocks."""


@dataclass(frozen=True)
class Behaviour:
    """Counts of one run or several.

    `mispredicted`: edits that failed, of those that were predicted to succeed. `surface`: edits
    that keep the mechanism, of those of a failed machine by an author who knew it; `local`: of all.
    `sizes`: tree edit distance of each edit, blocks. `errors`: predicted minus simulated score of
    each edit whose prediction names a score. `effort`: role -> tokens that its replies took, with
    reasoning, as reported by the endpoint; for a person, seconds of work like that of the role.
    """

    mispredicted: Rate = NONE
    surface: Rate = NONE
    local: Rate = NONE
    sizes: tuple[float, ...] = ()
    errors: tuple[float, ...] = ()
    effort: Mapping[str, float] = field(default_factory=dict)

    @property
    def shares(self) -> dict[str, float]:
        """Role -> its share of all effort; empty if none is reported."""
        whole = sum(self.effort.values())
        return {role: tokens / whole for role, tokens in self.effort.items()} if whole else {}

    @property
    def error(self) -> float | None:
        """Median size of the error of predicted scores; None if no score was predicted."""
        return statistics.median(map(abs, self.errors)) if self.errors else None

    @property
    def bias(self) -> float | None:
        """Median error of predicted scores; positive if they are too high."""
        return statistics.median(self.errors) if self.errors else None

    def __add__(self, other: Behaviour) -> Behaviour:
        roles = dict.fromkeys([*self.effort, *other.effort])
        return Behaviour(
            self.mispredicted + other.mispredicted,
            self.surface + other.surface,
            self.local + other.local,
            self.sizes + other.sizes,
            self.errors + other.errors,
            {role: self.effort.get(role, 0) + other.effort.get(role, 0) for role in roles},
        )


def behaviour(
    made: Sequence[Edit],
    prediction_of: Callable[[Location], str],
    change: Change,
    effort: Mapping[str, float],
    *,
    metres: bool,
) -> Behaviour:
    """How the designer of a run behaved.

    Args:
        made: Its edits.
        prediction_of: The prediction in the reply to a call; "" if there is none.
        change: Compares machines.
        effort: Role -> what its work took.
        metres: Whether the score of the task is a distance.
    """
    kept = [change.keeps_mechanism(one.before.machine, one.after.machine) for one in made]
    told = ["\n".join(map(prediction_of, one.replies)) for one in made]
    hopeful = [one.failed for one, words in zip(made, told, strict=True) if predicts_success(words)]
    failed = {one.after.machine for one in made if one.failed}
    repairs = [
        keeps
        for one, keeps in zip(made, kept, strict=True)
        if one.informed and (one.before.machine in failed or fails(one.before))
    ]
    scores = [predicted_score(words, metres=metres) for words in told]
    return Behaviour(
        Rate(sum(hopeful), len(hopeful)),
        Rate(sum(repairs), len(repairs)),
        Rate(sum(kept), len(kept)),
        tuple(change.size(one.before.machine, one.after.machine) for one in made),
        tuple(
            score - _score(one.after)
            for one, score in zip(made, scores, strict=True)
            if score is not None
        ),
        effort,
    )


def _score(result: EvaluationEvent) -> float:
    assert result.score is not None
    return result.score


NAME = 8
"""Characters of a content hash that name a machine to an agent."""


def agent_edits(events: Iterable[RunEvent | Event]) -> Iterator[Edit]:
    """The edits of an agent, in the order of their simulations.

    An agent may change a machine several times before it simulates it, so an edit leads from the
    nearest simulated ancestor. Machines that it wrote from scratch have no ancestor and are not
    edits. Edits are left out if a simulation of one of their machines crashed or timed out.
    """
    names: dict[str, str] = {}  # name -> content hash
    # content hash -> that of the machine it was made of, and whether scores were known
    parents: dict[str, tuple[str, bool]] = {}
    # content hash -> replies that made the machine or had it simulated
    turns: defaultdict[str, dict[Location, None]] = defaultdict(dict)
    results: dict[str, EvaluationEvent] = {}
    turn = Location()
    for event in events:
        if isinstance(event, AttemptEvent):  # the calls of a reply come after it
            turn = event.location
        elif isinstance(event, ToolEvent) and event.machine is not None and not event.refused:
            made = event.machine
            names[made[:NAME]] = made
            sent = event.arguments if isinstance(event.arguments, Mapping) else {}
            parent = names.get(str(sent.get("machine")))
            if parent and made != parent and made not in parents:
                parents[made] = parent, event.location.name == FEEDBACK
                turns[made][turn] = None
        elif isinstance(event, EvaluationEvent):
            names[event.machine[:NAME]] = event.machine
            if event.location.call:  # asked for by a tool, in this turn
                turns[event.machine][turn] = None
            if event.machine not in results:
                results[event.machine] = event
                yield from _edit_to(event, parents, turns, results)


def _edit_to(
    result: EvaluationEvent,
    parents: Mapping[str, tuple[str, bool]],
    turns: Mapping[str, Iterable[Location]],
    results: Mapping[str, EvaluationEvent],
) -> Iterator[Edit]:
    """The edit that led to a machine from its nearest ancestor in the results, if it has one."""
    replies, seen, at, informed = list[Location](), set[str](), result.machine, True
    while at in parents and at not in seen:
        seen.add(at)
        replies += turns.get(at, ())
        at, told = parents[at]
        informed &= told
        if before := results.get(at):
            if None not in (before.score, result.score):
                yield Edit(tuple(replies), before, result, informed)
            return

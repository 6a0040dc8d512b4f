"""Labels episodes with a language model, one at a time, in a sliding window of their neighbours."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from agentflow.agents.base import AskContext, Parsed, Prompt, ask
from agentflow.machine import extract_json, library
from agentflow.study.episodes import ALLOWED, MEANING, Episode, Label
from agentflow.study.session import Action, Session, Trial
from agentflow.study.transcript import Utterance, words_in

FOLDER = "_sessions"
"""Folder of the templates."""
BEFORE, AFTER = 4, 2
"""Episodes that are shown before and after the one to label; chosen."""


@dataclass(frozen=True)
class Window:
    """An episode and its neighbours, as a model sees them."""

    objective: str
    """The task in one sentence."""
    number: int
    """Of the episode to label, from 1."""
    rows: Sequence[Mapping[str, Any]]
    allowed: tuple[Label, ...]


class LabelPrompt(Prompt[Window, Label]):
    """Which label an episode has, of those that it may have."""

    name = f"{FOLDER}/label"

    def variables(self, given: Window) -> Mapping[str, object]:
        """The window in words."""
        labels = {label: MEANING[label] for label in given.allowed}
        return {
            "objective": given.objective,
            "number": given.number,
            "rows": given.rows,
            "labels": labels,
        }

    def parse(self, text: str, given: Window) -> Parsed[Label]:
        """The label; the problem names the allowed ones."""
        found = extract_json(text, dict)[0]
        answer = found.get("label") if found else None
        for label in given.allowed:
            if answer == label:
                return Parsed(label)
        told = "It has no JSON object with a label" if answer is None else f"{answer!r:.60} is none"
        problem = f'{told}: send {{"label": ...}} with one of {", ".join(given.allowed)}.'
        return Parsed(None, problem, "label", parsed=answer is not None)


async def label_by_model(
    session: Session,
    said: Sequence[Utterance],
    episodes: Sequence[Episode],
    objective: str,
    context: AskContext,
    say: Callable[[int, int], None],
) -> list[Episode]:
    """The episodes with their labels.

    An episode that may have only one label has it without a question. One for which no reply had an
    allowed label stays without.

    Args:
        session: The session.
        said: Everything that was said or noted.
        episodes: In the order of time.
        objective: The task in one sentence.
        context: How to ask.
        say: Receives progress: episodes that are labelled, of how many.
    """
    labelled = list(episodes)
    for index, episode in enumerate(episodes):
        allowed = ALLOWED[episode.coarse]
        label = next(iter(allowed), None)
        if len(allowed) > 1:
            rows = range(max(index - BEFORE, 0), min(index + AFTER + 1, len(episodes)))
            shown = [_row(session, said, number, labelled[number]) for number in rows]
            window = Window(objective, index + 1, shown, allowed)
            question = f"episode-{index + 1}"
            label = (await ask(LabelPrompt(), window, context, question)).output
        labelled[index] = episode.model_copy(update={"label": label})
        say(index + 1, len(episodes))
    return labelled


def _row(
    session: Session, said: Sequence[Utterance], index: int, episode: Episode
) -> dict[str, Any]:
    return {
        "number": index + 1,
        "begin": episode.begin,
        "end": episode.end,
        "coarse": episode.coarse,
        "label": episode.label,
        "events": ", ".join(
            describe_event(event)
            for event in session.events
            if isinstance(event, Action | Trial) and episode.begin <= event.at < episode.end
        ),
        "words": words_in(said, episode.begin, episode.end),
    }


def describe_event(event: Action | Trial) -> str:
    """An action or a trial in a few words."""
    if isinstance(event, Trial):
        score = event.status if event.score is None else f"score {event.score:.2f}"
        return f"simulate: {score}"
    kind = library().get(event.type) if event.type is not None else None
    return f"{event.do} {kind.name}" if kind else event.do

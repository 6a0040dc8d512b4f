"""Labels episodes: with a language model, one at a time among their neighbours, or by rules."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from agentflow.agents.base import AskContext, Parsed, Prompt, ask
from agentflow.app.inspect.behaviour import moving_types
from agentflow.machine import extract_json, library
from agentflow.metrics.behaviour.measures import fails
from agentflow.progress import Progress
from agentflow.study.episodes import ALLOWED, MEANING, Episode, Label
from agentflow.study.measures import count_restarts, edits_of, machine_at, result_of
from agentflow.study.session import Action, Session, StudioTest
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
    say: Progress,
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
            if isinstance(event, Action | StudioTest) and episode.begin <= event.at < episode.end
        ),
        "words": words_in(said, episode.begin, episode.end),
    }


def describe_event(event: Action | StudioTest) -> str:
    """An action or a trial in a few words."""
    if isinstance(event, StudioTest):
        score = event.status if event.score is None else f"score {event.score:.2f}"
        return f"simulate: {score}"
    kind = library().get(event.type) if event.type is not None else None
    return f"{event.do} {kind.name}" if kind else event.do


THINKING = ("pause", "talking")


def label_by_rules(session: Session, episodes: Sequence[Episode]) -> list[Episode]:
    """The episodes with their labels, by actions alone; breaks have none.

    * Building before the first trial is Build. Later it is Restructure if the types of moving
      blocks change or the machine is begun anew, else Revise.
    * A pause or talk before anything is built is Plan. It is Reflect if only such follow.
    * Right after a trial or a look at one, it is Diagnose if the last trial failed, else Observe.
    * All others are Plan before the first trial, and Hypothesize later.
    """
    rules = _Rules(session, episodes)
    return [
        episode.model_copy(update={"label": rules.label(number)})
        for number, episode in enumerate(episodes)
    ]


class _Rules:
    def __init__(self, session: Session, episodes: Sequence[Episode]) -> None:
        self._session, self._episodes = session, episodes
        self._trials = session.of(StudioTest)
        self._worse = {edit.after.machine for edit in edits_of(session) if edit.failed}

    def label(self, number: int) -> Label | None:
        episode = self._episodes[number]
        if episode.coarse == "building":
            return self._label_building(episode)
        if episode.coarse in THINKING:
            return self._label_thinking(number)
        return next(iter(ALLOWED[episode.coarse]), None)

    def _label_building(self, episode: Episode) -> Label:
        if not self._last_trial(episode):
            return "Build"
        before = machine_at(self._session, episode.begin)
        after = machine_at(self._session, episode.end)
        given = len(self._session.machine(self._session.start))
        anew = count_restarts([len(before) - given, len(after) - given])
        return "Restructure" if anew or moving_types(before) != moving_types(after) else "Revise"

    def _label_thinking(self, number: int) -> Label:
        done = [one.coarse for one in self._episodes[:number]]
        to_come = {one.coarse for one in self._episodes[number + 1 :]}
        trial = self._last_trial(self._episodes[number])
        if "building" not in done and not trial:
            return "Plan"
        if to_come <= {*THINKING, "break"}:
            return "Reflect"
        if trial and done[-1] in ("testing", "looking"):
            return "Diagnose" if self._failed(trial) else "Observe"
        return "Hypothesize" if trial else "Plan"

    def _last_trial(self, episode: Episode) -> StudioTest | None:
        return next((one for one in reversed(self._trials) if one.at < episode.begin), None)

    def _failed(self, trial: StudioTest) -> bool:
        result = result_of(self._session, trial)
        return trial.score is None or fails(result) or result.machine in self._worse

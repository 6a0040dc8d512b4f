"""Segments a session: cuts it into episodes, which a model labels one at a time among their
neighbours, or rules; reads and writes the result."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel

from agentflow.agents.base import AskContext, Parsed, Prompt, ask
from agentflow.agents.designer import Designer
from agentflow.app.inspect.behaviour import moving_types
from agentflow.app.tasks import find_task
from agentflow.config.run import DesignConfig
from agentflow.errors import ConfigError, RunError
from agentflow.files.atomic import remove_partial_files
from agentflow.files.documents import Document
from agentflow.files.folders import hold_folder
from agentflow.llm.messages import Client
from agentflow.llm.procedural import ProceduralClient
from agentflow.machine import extract_json, library
from agentflow.metrics.behaviour import fails
from agentflow.metrics.tables import NOTHING, Column, Row, Table
from agentflow.models.choices import choose_models, continuable, recorded_models
from agentflow.models.completion import find_unused_setting
from agentflow.progress import Progress, silent
from agentflow.prompts.render import PromptSet
from agentflow.runs import Notify
from agentflow.study.episodes import (
    ALLOWED,
    MEANING,
    Coarse,
    Episode,
    Label,
    Utterance,
    cut,
    read_transcript,
    words_in,
)
from agentflow.study.measures import count_restarts, edits_of, machine_at, result_of
from agentflow.study.session import Action, Audio, Note, Session, StudioTest, read_session

FOLDER = "_sessions"
BEFORE, AFTER = 4, 2
"""Episodes that are shown before and after the one to label; chosen."""


@dataclass(frozen=True)
class Window:
    """An episode and its neighbours, as a model sees them."""

    objective: str
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
        missing = "It has no JSON object with a label"
        told = missing if answer is None else f"{answer!r:.60} is not a label"
        problem = f'{told}: send {{"label": ...}} with one of {", ".join(given.allowed)}.'
        return Parsed(None, problem, "label", parsed=answer is not None)


async def label_by_model(
    session: Session,
    segments: Segments,
    config: DesignConfig,
    client: Client | None,
    notify: Notify,
    say: Progress,
) -> Segments:
    """The segments with the labels that a model gives.

    An episode that may have only one label has it without a question. One for which no reply had an
    allowed label stays without.

    Args:
        session: The session.
        segments: Its episodes, and what was said.
        config: The model, and how to ask it.
        client: Answers in place of the configured model.
        notify: Receives remarks for the user.
        say: Receives progress: episodes that are labelled, of how many.
    """
    objective = find_task(session.start.task).brief.objective
    said, labelled = everything_said(session, segments), list(segments.episodes)
    async with recorded_models(config, session.path, notify, client) as models:
        asked = models.clients[ROLE]
        notify(f"{asked.name} gets the actions and words of this session to label them")
        context = AskContext(asked, PromptSet(config.prompts), models.choices[ROLE].sampling)
        for index, episode in enumerate(segments.episodes):
            allowed = ALLOWED[episode.coarse]
            label = next(iter(allowed), None)
            if len(allowed) > 1:
                rows = range(max(index - BEFORE, 0), min(index + AFTER + 1, len(labelled)))
                shown = [_row(session, said, number, labelled[number]) for number in rows]
                window = Window(objective, index + 1, shown, allowed)
                question = f"episode-{index + 1}"
                label = (await ask(LabelPrompt(), window, context, question)).output
            labelled[index] = episode.model_copy(update={"label": label})
            say(index + 1, len(labelled))
    return segments.model_copy(update={"model": asked.name, "episodes": tuple(labelled)})


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
      blocks change or the machine is started over, else Revise.
    * A pause or talk before anything is built is Plan. It is Reflect if only such follow.
    * Right after a trial or a look at one, it is Diagnose if the last trial failed, else Observe.
    * All others are Plan before the first trial, and Hypothesize later.
    """
    worse = {edit.after.machine for edit in edits_of(session) if edit.failed}
    kinds = [episode.coarse for episode in episodes]
    labelled = []
    for number, episode in enumerate(episodes):
        trials = [trial for trial in session.of(StudioTest) if trial.at < episode.begin]
        label: Label | None = next(iter(ALLOWED[episode.coarse]), None)
        if episode.coarse == "building":
            label = _label_revision(session, episode) if trials else "Build"
        elif episode.coarse in THINKING:
            failed = None
            if trials:
                result = result_of(session, trials[-1])
                failed = result.score is None or fails(result) or result.machine in worse
            label = _label_thinking(kinds[:number], {*kinds[number + 1 :]}, failed)
        labelled.append(episode.model_copy(update={"label": label}))
    return labelled


def _label_revision(session: Session, episode: Episode) -> Label:
    before, after = machine_at(session, episode.begin), machine_at(session, episode.end)
    given = len(session.machine(session.start))
    anew = count_restarts([len(before) - given, len(after) - given])
    return "Restructure" if anew or moving_types(before) != moving_types(after) else "Revise"


def _label_thinking(done: Sequence[str], to_come: set[Coarse], failed: bool | None) -> Label:
    """By what goes on before and after; `failed` is about the last trial, None before the first."""
    if "building" not in done and failed is None:
        return "Plan"
    if to_come <= {*THINKING, "break"}:
        return "Reflect"
    if failed is not None and done[-1] in ("testing", "looking"):
        return "Diagnose" if failed else "Observe"
    return "Plan" if failed is None else "Hypothesize"


FILE = "episodes.json"
ROLE = Designer.name


class Segments(BaseModel, frozen=True, extra="forbid"):
    """The content of episodes.json.

    `model` gave the labels, `transcript` is the name of a file, and `seconds` the length of the
    session when it was cut.
    """

    format: Literal[1] = 1
    model: str
    transcript: str | None = None
    seconds: float
    spoken: tuple[Utterance, ...] = ()
    episodes: tuple[Episode, ...]

    @property
    def unlabelled(self) -> int:
        """Episodes at work for which no reply had an allowed label."""
        return sum(one.label is None and one.coarse != "break" for one in self.episodes)


DOCUMENT = Document(FILE, Segments, "a segmented session")


def segment(
    path: Path,
    transcript: Path | None,
    config: DesignConfig,
    *,
    client: Client | None = None,
    notify: Notify = lambda _line: None,
    say: Progress = silent,
) -> Segments:
    """Cut a session into episodes, label them, and write episodes.json in its folder.

    Recorded calls of a model are not made again.

    Args:
        path: The session.
        transcript: What was said, as WebVTT or SubRip. Its times count from the start of the
            session, or from when the microphone was switched on.
        config: The model; the built-in one labels by rules. Only its sampling, budget and endpoint,
            the prompt set and the seed are used besides.
        client: Answers in place of the configured model.
        notify: Receives remarks for the user.
        say: Receives progress.

    Raises:
        UsageError: The session or the transcript cannot be read, or a setting does not apply.
        EndpointError: The model cannot be used; what it has answered is kept.
        InterruptedRunError: Ctrl-C.
    """
    if key := find_unused_setting(config, ("knobs",)):
        raise ConfigError(f"labels of a session do not depend on {key}; leave it out")
    session = read_session(path)
    audio = session.of(Audio)
    shift = audio[0].at if audio else 0.0
    spoken = () if transcript is None else read_transcript(transcript, shift)
    cut_only = Segments(
        model=ProceduralClient.name,
        transcript=None if transcript is None else transcript.name,
        seconds=session.seconds,
        spoken=spoken,
        episodes=tuple(cut(session, spoken)),
    )
    with continuable(), hold_folder(session.path):
        remove_partial_files(session.path)
        if client is None and choose_models(config.model)[ROLE].procedural:
            episodes = label_by_rules(session, cut_only.episodes)
            labelled = cut_only.model_copy(update={"episodes": tuple(episodes)})
        else:
            asked = label_by_model(session, cut_only, config, client, notify, say)
            labelled = asyncio.run(asked)
        DOCUMENT.write(session.path, labelled)
    return labelled


def read_segments(session: Session) -> Segments:
    """The episodes of a session: as they were labelled, or by rules if they never were.

    Raises:
        RunError: They are damaged, or the session went on after they were cut.
    """
    if not (session.path / FILE).exists():
        episodes = label_by_rules(session, cut(session, ()))
        name, seconds = ProceduralClient.name, session.seconds
        return Segments(model=name, seconds=seconds, episodes=tuple(episodes))
    found = DOCUMENT.read(session.path)
    if found.seconds != session.seconds:
        raise RunError(
            f"{session.path / FILE} is about the first {found.seconds:.0f} s, and the session has "
            f"{session.seconds:.0f} s; run agentflow study segments again"
        )
    return found


def everything_said(session: Session, segments: Segments) -> tuple[Utterance, ...]:
    """What was said and what was noted, in the order of time."""
    noted = [Utterance(begin=n.at, end=n.at, text=n.text) for n in session.of(Note)]
    return tuple(sorted((*segments.spoken, *noted), key=lambda one: one.begin))


def table_of(segments: Segments) -> Table:
    """The episodes in lines."""
    rows = tuple(
        Row((str(number), one.coarse, one.label or NOTHING), (one.begin, one.seconds))
        for number, one in enumerate(segments.episodes, start=1)
    )
    columns = (Column("", "begins, s", digits=1), Column("", "seconds", digits=1))
    lost = f" {segments.unlabelled} of them have no label." if segments.unlabelled else ""
    note = f"Labels are from {segments.model}.{lost}"
    heads = ("episode", "what goes on", "label")
    return Table("Episodes", heads, columns, rows, notes=(note,))

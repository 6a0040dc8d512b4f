"""Segments a session: cuts it into episodes and labels them; reads and writes the result."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Literal

from pydantic import BaseModel

from agentflow.agents.base import AskContext
from agentflow.agents.designer import Designer
from agentflow.app.tasks import find_task
from agentflow.config.run import DesignConfig
from agentflow.errors import ConfigError, RunError
from agentflow.files.atomic import remove_partial_files
from agentflow.files.documents import Document
from agentflow.files.folders import hold_folder
from agentflow.llm.client import Client
from agentflow.llm.procedural import ProceduralClient
from agentflow.metrics.formats import NOTHING
from agentflow.metrics.tables import FORMATS, Column, Row, Table
from agentflow.models.choices import choose_models
from agentflow.models.clients import continuable, recorded_models
from agentflow.models.completion import find_unused_setting
from agentflow.progress import Progress, silent
from agentflow.prompts.render import PromptSet
from agentflow.runs import Notify
from agentflow.study.episodes import Episode, cut
from agentflow.study.labelling import label_by_model, label_by_rules
from agentflow.study.session import Audio, Note, Session, read_session
from agentflow.study.transcript import Utterance, read_transcript

FILE = "episodes.json"
ROLE = Designer.name
"""The role whose model labels."""


class Segments(BaseModel, frozen=True, extra="forbid"):
    """The content of episodes.json."""

    format: Literal[1] = 1
    model: str
    """Name of the model that gave the labels."""
    transcript: str | None = None
    """Name of the file of the transcript."""
    seconds: float
    """Length of the session when it was cut."""
    spoken: tuple[Utterance, ...] = ()
    """The transcript."""
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
            asked = _ask_model(session, cut_only, config, client, notify, say)
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


async def _ask_model(
    session: Session,
    segments: Segments,
    config: DesignConfig,
    client: Client | None,
    notify: Notify,
    say: Progress,
) -> Segments:
    objective = find_task(session.start.task).brief.objective
    async with recorded_models(config, session.path, notify, client) as models:
        asked = models.clients[ROLE]
        notify(f"{asked.name} gets the actions and words of this session to label them")
        sampling = models.choices[ROLE].sampling
        context = AskContext(asked, PromptSet(config.prompts), sampling)
        said = everything_said(session, segments)
        episodes = await label_by_model(session, said, segments.episodes, objective, context, say)
    return segments.model_copy(update={"model": asked.name, "episodes": tuple(episodes)})


def format_segments(segments: Segments, form: str) -> str:
    """The episodes as text in one of the `FORMATS`."""
    rows = tuple(
        Row((str(number), one.coarse, one.label or NOTHING), (one.begin, one.seconds))
        for number, one in enumerate(segments.episodes, start=1)
    )
    columns = (Column("", "begins, s", digits=1), Column("", "seconds", digits=1))
    lost = f" {segments.unlabelled} of them have no label." if segments.unlabelled else ""
    note = f"Labels are from {segments.model}.{lost}"
    heads = ("episode", "what goes on", "label")
    return FORMATS[form](Table("Episodes", heads, columns, rows, notes=(note,)))

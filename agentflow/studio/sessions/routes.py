"""Where the page begins, records and lists sessions."""

from __future__ import annotations

import asyncio
import base64
from typing import Any, Literal

from pydantic import Field
from starlette.routing import BaseRoute

from agentflow.app.pages.runs import FINE, ReportedMachine
from agentflow.app.tasks import find_task
from agentflow.errors import UsageError
from agentflow.studio.answers import Arguments, Hash, Name, Nothing, get, post
from agentflow.studio.building.routes import SEED, MachineForTask
from agentflow.studio.sessions.recorder import SessionRecorder
from agentflow.studio.sessions.replay import replay_data
from agentflow.studio.simulations import Simulations
from agentflow.study.session import SessionStart


class NewSession(MachineForTask):
    """The form of a session, and the machine that it begins with."""

    mode: Literal["free", "guided"] = "free"
    rationale: str = Field("", max_length=20_000)
    limit_s: float | None = Field(None, gt=0, le=86_400, allow_inf_nan=False)
    participant: str = Field("", pattern=r"^[A-Za-z0-9_-]{0,40}$")
    consent: str = Field("", max_length=20_000)
    agreed: bool = False
    """Whether the person has read the consent text and agreed to it."""
    refine: bool = True


class Named(Arguments):
    """A session by name."""

    session: Name


class MachineOfSession(Named):
    """A machine of a session by content hash."""

    machine: Hash
    film: Literal["", "yes"] = ""
    """Whether it is simulated, or shown as built."""


class Event(Named):
    """What has happened."""

    event: dict[str, Any]


class Clock(Named):
    """Whether the clock is stopped."""

    paused: bool


class Sound(Named):
    """A piece of a recording, in base64."""

    data: str = Field(max_length=4_000_000)
    first: bool


class Sessions:
    """Answers about sessions."""

    def __init__(self, recorder: SessionRecorder, simulations: Simulations) -> None:
        """Answer with what a recorder writes."""
        self._recorder, self._simulations = recorder, simulations

    @property
    def routes(self) -> list[BaseRoute]:
        """Where the page asks."""
        return [
            get("/api/sessions", Nothing, self.list),
            get("/api/session", Nothing, self.current),
            get("/api/session/replay", Named, self.replay),
            get("/api/session/machine", MachineOfSession, self.machine),
            post("/api/session/begin", NewSession, self.begin),
            post("/api/session/event", Event, self.tell),
            post("/api/session/pause", Clock, self.pause),
            post("/api/session/sound", Sound, self.hear),
            post("/api/session/end", Named, self.end),
        ]

    async def list(self, _given: Nothing) -> list[dict[str, Any]]:
        """Every session in a few numbers."""
        return await asyncio.to_thread(lambda: list(self._recorder.sessions()))

    async def current(self, _given: Nothing) -> dict[str, Any] | None:
        """The session that is open."""
        return self._recorder.current()

    async def begin(self, given: NewSession) -> dict[str, Any]:
        """Begin a session."""
        machine, _ = given.read()
        guided = given.mode == "guided"
        if guided and not given.rationale.strip():
            raise UsageError("a guided session shows a rationale; write one")
        consent = given.consent.strip()
        if consent and not given.agreed:
            raise UsageError("the session begins once the person has agreed to the consent text")
        return self._recorder.begin(
            SessionStart(
                task=given.task,
                limit_s=given.limit_s,
                mode=given.mode,
                rationale=given.rationale if guided else "",
                participant=given.participant,
                consent=consent,
                refine=given.refine,
                machine=machine.to_json(),
            )
        )

    async def replay(self, given: Named) -> dict[str, Any]:
        """What happened in a session, and when."""
        return replay_data(await asyncio.to_thread(self._recorder.read, given.session))

    async def machine(self, given: MachineOfSession) -> dict[str, Any]:
        """A machine of a session: the shapes and files that it uses are in the answer."""
        session = await asyncio.to_thread(self._recorder.read, given.session)
        if given.machine not in session.machines:
            raise UsageError("this session has no such machine")
        task, interval = find_task(session.start.task), FINE if given.film else None
        item = ReportedMachine(session.machines[given.machine], task, SEED, None, interval)
        return await self._simulations.film(item)

    async def tell(self, given: Event) -> dict[str, Any]:
        """Record what has happened."""
        return {"left_s": self._recorder.tell(given.session, given.event)}

    async def pause(self, given: Clock) -> dict[str, Any]:
        """Stop the clock, or let it run again."""
        return {"left_s": self._recorder.pause(given.session, given.paused)}

    async def hear(self, given: Sound) -> dict[str, Any]:
        """Record a piece of sound."""
        try:
            sound = base64.b64decode(given.data, validate=True)
        except ValueError:  # binascii.Error, or characters beyond ASCII
            raise UsageError("the sound must be base64") from None
        self._recorder.hear(given.session, sound, given.first)
        return {}

    async def end(self, given: Named) -> dict[str, Any]:
        """End a session."""
        self._recorder.end(given.session)
        return {}

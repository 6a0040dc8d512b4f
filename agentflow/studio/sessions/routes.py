"""Where the page begins, records and lists sessions."""

from __future__ import annotations

import asyncio
import base64
from typing import Any, Literal

from pydantic import Field
from starlette.routing import BaseRoute

from agentflow.errors import UsageError
from agentflow.studio.answers import Arguments, Nothing, get, post
from agentflow.studio.building.routes import MachineForTask
from agentflow.studio.folder import LONGEST
from agentflow.studio.sessions.recorder import SessionRecorder
from agentflow.study.session import SessionStart


class NewSession(MachineForTask):
    """The form of a session, and the machine that it begins with."""

    mode: Literal["free", "guided"] = "free"
    rationale: str = Field("", max_length=20_000)
    limit_s: float | None = Field(None, gt=0, le=86_400, allow_inf_nan=False)


class Named(Arguments):
    """The session that the page has open."""

    session: str = Field(max_length=LONGEST)


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

    def __init__(self, recorder: SessionRecorder) -> None:
        """Answer with what a recorder writes."""
        self._recorder = recorder

    @property
    def routes(self) -> list[BaseRoute]:
        """Where the page asks."""
        return [
            get("/api/sessions", Nothing, self.list),
            get("/api/session", Nothing, self.current),
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
        return self._recorder.begin(
            SessionStart(
                task=given.task,
                limit_s=given.limit_s,
                mode=given.mode,
                rationale=given.rationale if guided else "",
                machine=machine.to_json(),
            )
        )

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

"""Grabbers: each holds the first object that it touches until it is switched off."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Generic, TypeVar

from agentflow.env.physics.laws.forces import Entry
from agentflow.env.physics.model import Gripper

EDGE = 0.05
"""Contacts at most this far behind a grabber's front plane are on its front, m."""

Held = int | str
"""A part, or an object's name."""

Hold = TypeVar("Hold")
"""Something gripped, and where, as an engine notes it."""


class Grips(ABC, Generic[Hold]):
    """All grabbers of one machine; how they grip is the engine's own.

    They outlive splits, so they name parts and objects, and are bound again when bodies are
    rebuilt.
    """

    def __init__(self, grips: Sequence[Gripper]) -> None:
        """Start with nothing gripped."""
        self._grips = grips
        self._holds: dict[int, Hold] = {}
        """By part of the grabber."""
        self.entries: set[Entry] = {"grabbers", *(grip.starts for grip in grips)}
        """Entries of which a level opens or closes some of them."""
        self._off: set[Entry] = set()
        """Those at 0, whose grabbers do not grip."""

    def switch(self, entry: Entry, on: bool) -> None:
        """Let the grabbers of an entry let go of everything, or get ready to grip."""
        (self._off.discard if on else self._off.add)(entry)
        parts = [grip.part for grip in self._grips if grip.starts == entry]
        if not on:
            self._release([part for part in parts if part in self._holds])

    @abstractmethod
    def _release(self, parts: Sequence[int]) -> None:
        """Let these grabbers let go of what they hold."""

    @abstractmethod
    def _tie(self, part: int, hold: Hold) -> None:
        """Hold something with a grabber from now on."""

    def _tie_again(self) -> None:
        """Hold everything that was held, in new bodies that are where the old ones were."""
        for part, hold in self._holds.items():
            self._tie(part, hold)

"""What a bench needs from the outside: simulations, pictures and a record."""

from collections.abc import Sequence
from dataclasses import dataclass
from random import Random
from typing import Any, Literal, Protocol

from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine
from agentflow.runs.events import RunEvent
from agentflow.runs.locations import Location

ViewDirection = Literal["front", "side", "top", "iso"]
"""Directions of pictures: from ahead (z+), from the right (x+), from above, from above at the right
behind."""


@dataclass(frozen=True)
class Shot:
    """What a picture of a machine shows."""

    view: ViewDirection = "iso"
    times: tuple[float, ...] = ()
    """Moments of its simulation, at most four, in seconds since t = 0; () for as built."""
    follow: int | str | None = None
    """Block or moving object of the scene that the camera follows; None: the root."""
    within: float = 12.0
    """How far from it blocks are in the frame, m."""
    trial: int = 0
    """Number of the trial, from 1; 0 for the one that is shown by default."""


@dataclass(frozen=True)
class Told:
    """An answer about a simulation: words for an agent, and the same as JSON data."""

    text: str
    data: Any


@dataclass(frozen=True)
class Aims:
    """What a score of the task is worth, and how the final one is made."""

    good: float | None = None
    """A good score; None if the task has changed knobs."""
    record: float | None = None
    """The best known verified score, if the agent is to know it."""
    most_changes: int = 0
    """Most simulations with changed conditions that verify a machine of the task."""
    changes: str = ""
    """What they change, in a phrase."""


class Simulation(Protocol):
    """The result of a simulation."""

    @property
    def score(self) -> float | None:
        """None if the simulation crashed or timed out."""

    @property
    def status(self) -> str:
        """ok, invalid, diverged, timeout, crashed."""

    @property
    def feedback(self) -> str:
        """What happened, as text."""

    @property
    def broken(self) -> Sequence[tuple[int, int, float]]:
        """(block, partner, seconds since t = 0) of each broken connection."""


class BenchHost(Protocol):
    """One task, where machines are simulated and everything is recorded."""

    @property
    def brief(self) -> Brief:
        """The task as plain data."""

    @property
    def brief_text(self) -> str:
        """The task, the blocks and the rules as designers see them."""

    @property
    def aims(self) -> Aims:
        """What a score is worth, and how the final one is made."""

    def stream(self, name: str) -> Random:
        """A random stream for one purpose, derived from the run's seed and the name."""

    def simulated(self, machine: Machine) -> Simulation | None:
        """The result of a finished simulation; None without one."""

    async def simulate(self, machine: Machine, location: Location) -> Simulation:
        """Simulate a machine once; concurrent calls share it until the last one is cancelled."""

    def count_changes(self, machine: Machine) -> int:
        """How many simulations verifying a simulated machine takes."""

    async def verify(self, machine: Machine) -> Told:
        """How the score of a simulated machine holds under small changes: `score`, `low`, `high`
        and `scores` as data, as in the result of a run; without a score if one timed out."""

    async def feedback(self, machine: Machine, trial: int) -> Told:
        """What happened in the simulation of a simulated machine.

        Args:
            machine: The machine.
            trial: Number of the trial to tell about, from 1; 0 for the usual one.

        Raises:
            UsageError: There is no such trial.
        """

    async def query(
        self, machine: Machine, queries: Sequence[object], location: Location | None
    ) -> Told:
        """Recorded states of a simulated machine, as tables and as a list with one item for each
        query; a query may name a `trial` and an `interval` between rows, s. Without a location, the
        run does not record it."""

    async def look(self, machine: Machine, shot: Shot) -> bytes:
        """A PNG picture of a machine.

        Raises:
            UsageError: There is no such time, trial, or nothing such to follow.
        """

    def save(self, machine: Machine) -> None:
        """Store a machine by its content hash; the same machine may come twice."""

    def note(self, event: RunEvent) -> None:
        """Record an event."""

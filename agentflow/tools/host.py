"""What a bench needs from the outside: simulations, pictures and a record."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any, Literal, Protocol

from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine
from agentflow.runs.events import RunEvent
from agentflow.runs.locations import Location
from agentflow.search.node import Evaluation

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


@dataclass(frozen=True)
class SimulationSummary:
    """A simulation as workflows see it: the `details` of an evaluator's evaluation."""

    score: float | None
    status: str
    """ok, invalid, diverged, timeout, crashed."""
    feedback: str
    """The default feedback, as models read it."""
    broken: tuple[tuple[int, int, float], ...] = ()
    """(block, partner, seconds since t = 0) of each broken connection."""
    digest: str | None = None
    """Hash of every recorded state."""
    moved: float | None = None
    """Largest displacement of any block's centre from its start, m; None without states."""
    mechanism: str | None = None
    """Class of the machine's mechanism; None if the simulation does not show it."""
    success: bool | None = None
    """Whether the task's criterion of success is met; None if it has none."""
    met: tuple[int, int] | None = None
    """How many requirements are met, of how many; None without any."""
    facts: Mapping[str, str] = field(default_factory=dict)
    """What edit histories report besides the score: name -> value."""


class Evaluator(Protocol):
    """Simulates machines for the task of a run."""

    async def evaluate(self, machine: Machine, label: str) -> Evaluation:
        """Simulate a machine; the result's `details` are a `SimulationSummary`."""

    @property
    def aims(self) -> Aims:
        """What a score is worth, and how the final one is made."""

    def count_changes(self, machine: Machine) -> int:
        """How many simulations `verified` takes."""

    async def verified(self, machine: Machine) -> Told:
        """How the score of an evaluated machine holds under small changes: `score`, `low`, `high`
        and `scores` as data, as in the result of a run; without a score if one timed out."""

    async def feedback(self, machine: Machine, trial: int) -> Told:
        """What happened in the simulation of an evaluated machine.

        Args:
            machine: The machine.
            trial: Number of the trial to tell about, from 1; 0 for the usual one.

        Raises:
            UsageError: There is no such trial.
        """

    async def query(self, machine: Machine, queries: Sequence[object]) -> Told:
        """Recorded states of an evaluated machine; see `BenchHost.query`."""

    async def views(self, machine: Machine) -> tuple[str, ...]:
        """Pictures of a machine as built, as PNG data URLs; always the same bytes."""

    async def look(self, machine: Machine, shot: Shot) -> bytes:
        """A PNG picture with axes, scale and block ids.

        Raises:
            UsageError: There is no such time, trial, or nothing such to follow.
        """


class BenchHost(Protocol):
    """One task, where machines are simulated and everything is recorded."""

    @property
    def brief(self) -> Brief:
        """The task as plain data."""

    @property
    def brief_text(self) -> str:
        """The task, the blocks and the rules as designers see them."""

    @property
    def evaluator(self) -> Evaluator:
        """For what a run does not record: verification, feedback and pictures. Tools simulate and
        query through the host, which shares and records both."""

    def stream(self, name: str) -> Random:
        """A random stream for one purpose, derived from the run's seed and the name."""

    def simulated(self, machine: Machine) -> SimulationSummary | None:
        """The result of a finished simulation; None without one."""

    async def simulate(self, machine: Machine, location: Location) -> SimulationSummary:
        """Simulate a machine once; concurrent calls share it until the last one is cancelled."""

    async def query(
        self, machine: Machine, queries: Sequence[object], location: Location | None
    ) -> Told:
        """Recorded states of a simulated machine, as tables and as a list with one item for each
        query; a query may name a `trial` and an `interval` between rows, s. Without a location, the
        run does not record it."""

    def save(self, machine: Machine) -> None:
        """Store a machine by its content hash; the same machine may come twice."""

    def note(self, event: RunEvent) -> None:
        """Record an event."""

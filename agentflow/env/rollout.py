"""The result of a rollout: recorded states, breakages, events, score and feedback.

Arrays are float64 in the game frame; T samples, N blocks (index = block id), E connections,
L two-ended blocks, M scene objects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from agentflow.env.constants import constants
from agentflow.env.measurements import Measured, Recorded
from agentflow.env.scene import Scene
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.problems import Problem
from agentflow.machine.requirements import Judged
from agentflow.machine.tree import Machine

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]
Status = Literal["ok", "invalid", "diverged", "timeout", "crashed"]


@dataclass(frozen=True)
class Trace:
    """States from t = 0 (after settling): at regular times, and finer around events."""

    times: Array
    """(T,) seconds; not evenly spaced, see `regular`."""
    position: Array
    """(T, N, 3) block origins (building points), m. Two-ended blocks: midpoint of their ends."""
    centre: Array
    """(T, N, 3) box centres, m; the positions that designers see."""
    rotation: Array
    """(T, N, 4) quaternions x, y, z, w."""
    velocity: Array
    """(T, N, 3) of the block's centre, m/s."""
    angular_velocity: Array
    """(T, N, 3) rad/s."""
    alive: Flags
    """(T, N) whether the block still holds on to its parent."""
    length: Array
    """(T, L) distance between the ends of two-ended blocks, m; column i belongs to linear[i]."""
    linear: tuple[int, ...]
    """Ids of the two-ended blocks."""
    pull: Array
    """(T, L) pull of springs and winches, N; nan for others, and in records from before this was
    recorded. The digest covers neither this nor `work`."""
    work: Array
    """(T, L) their work since t = 0, J; nan as in `pull`."""
    utilisation: Array
    """(T, E) greatest load over strength of each connection since the sample before; it breaks at
    1.0, nan from then on."""
    connections: tuple[tuple[int, int], ...]
    """(block, partner) of each connection."""
    object_position: Array
    """(T, M, 3) centres."""
    object_rotation: Array
    """(T, M, 4)."""
    object_velocity: Array
    """(T, M, 3)."""
    objects: tuple[str, ...]
    """Names of the scene's moving objects, in scene order."""
    regular: Flags
    """(T,) whether a sample is one of those at equal intervals; the others are around events."""
    measured: Measured = field(default_factory=Measured)
    """What was measured at every step: see `measurements`."""

    def __getitem__(self, picks: slice | Flags) -> Trace:
        """The trace of some of its samples."""
        arrays = {n: v[picks] for n, v in vars(self).items() if isinstance(v, np.ndarray)}
        return replace(self, **arrays)  # type: ignore[arg-type]

    @property
    def even(self) -> Trace:
        """The samples at equal intervals."""
        return self if self.regular.all() else self[self.regular]


@dataclass(frozen=True)
class _ConnectionLoad(Recorded):
    """The load over strength of one connection at one moment, in seconds since t = 0."""

    block: int
    type: int
    partner: int
    time: float
    load: float


@dataclass(frozen=True)
class Broken(_ConnectionLoad):
    """One connection that broke, as it broke."""

    force: Vec3 = (0.0, 0.0, 0.0)
    """N; as in `measurements.Peak`."""
    moment: Vec3 = (0.0, 0.0, 0.0)
    """N m."""


@dataclass(frozen=True)
class Marginal(_ConnectionLoad):
    """One connection that came within 5 % of breaking, where its load was greatest, or that broke
    under a load at most 5 % above its strength: small changes decide whether it breaks."""


@dataclass(frozen=True)
class RolloutEvent(Recorded):
    """An event in the feedback to designers, other than a breakage."""

    time: float
    kind: str
    blocks: tuple[int, ...] = ()
    text: str = ""


@dataclass(frozen=True)
class Moment:
    """The moment that decides a score: loads are reported before and after it, energies at it."""

    time: float
    name: str
    """Such as "release"."""
    body: int | str | None = None
    """Block or object that is thrown, carried or pushed; None if the machine itself moves."""
    holder: int | None = None
    """Block that it left."""


@dataclass(frozen=True)
class Verdict:
    """A task's score of a trace."""

    score: float
    """The score, in the task's unit."""
    terms: Mapping[str, float | bool | str | None]
    """Every part of the score by name."""
    events: tuple[RolloutEvent, ...] = ()
    """Events to report to designers."""
    moment: Moment | None = None
    """None: no moment decides more than the others."""


@dataclass(frozen=True)
class Feedback:
    """Feedback to designers after a rollout: the same content as text and as data."""

    text: str
    """The feedback as sentences."""
    data: Mapping[str, Any]
    """The same content as JSON data."""


@dataclass(frozen=True, repr=False)
class Rollout:
    """The result of simulating one machine in one task.

    `diverged` is the machine's fault and scores 0; `timeout` and `crashed` are the computer's and
    have score None; `invalid` machines are not simulated and score 0.
    """

    status: Status
    """How the simulation ended."""
    score: float | None
    """The score, in the task's unit; None after a time-out or crash."""
    feedback: Feedback
    """The feedback for designers."""
    terms: Mapping[str, float | bool | str | None] = field(default_factory=dict)
    """Every part of the score by name."""
    problems: tuple[Mapping[str, Any], ...] = ()
    """Why it is invalid: code, blocks and message of each problem."""
    broken: tuple[Broken, ...] = ()
    """The connections that broke, in order of time."""
    marginal: tuple[Marginal, ...] = ()
    """In order of time; of several trials, those of all."""
    events: tuple[RolloutEvent, ...] = ()
    """Other events that the feedback reports, in order of time."""
    trace: Trace | None = None
    """The recorded states; None if nothing was simulated or recorded."""
    digest: str | None = None
    """Hash of every recorded state: equal digests mean bitwise equal rollouts."""
    sim_seconds: float | None = None
    """Simulated time."""
    wall_seconds: float | None = None
    """Time that the simulation took."""
    constants: str | None = None
    """Hash of the physical constants."""
    scene: Scene | None = None
    """Scene of the trace; not saved in files."""
    engine: str | None = None
    """Name and library version of the physics engine; None if nothing was simulated."""
    requirements: tuple[Judged, ...] = ()
    """Those of the task, with what the machine has; () without any, and where nothing was
    simulated."""
    machine: Machine | None = field(default=None, compare=False)
    """What was simulated, where Python programs ask for it; not saved in files."""

    def __repr__(self) -> str:
        seconds = "" if self.sim_seconds is None else f", {self.sim_seconds:g} s"
        broken = f", {len(self.broken)} broken" if self.broken else ""
        return f"<Rollout {self.status}, score {self.score}{seconds}{broken}>"


def invalid_rollout(problems: Sequence[Problem], engine: str | None = None) -> Rollout:
    """The result of a machine that is not simulated because of these problems.

    Args:
        problems: Why the machine is invalid.
        engine: The engine that cannot hold it, if that is the reason.
    """
    listed = tuple(problem.to_json() for problem in problems)
    text = "The machine is invalid and was not simulated: " + "; ".join(
        str(problem["message"]) for problem in listed
    )
    return Rollout(
        status="invalid",
        score=0.0,
        feedback=Feedback(text, {"status": "invalid", "problems": list(listed)}),
        problems=listed,
        constants=constants().digest,
        engine=engine,
    )

"""What function tests measure in a rollout, and their thresholds as written in YAML.

Game frame; metres, seconds, radians. T samples, N blocks. Only blocks that still hold on to the
machine count as parts of it: debris that flies or rolls says nothing about how a machine works.
"""

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, Field

from agentflow.env.feedback.text import object_label
from agentflow.env.rollout import Array, Flags, Rollout, Trace
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import ROOT, Machine

Direction = Literal["x+", "x-", "y+", "y-", "z+", "z-", "any"]
"""An axis of the game frame; "any" is any horizontal direction."""
MEAN_OVER = 1.0
"""Speeds are means over this time, so that a jolt is not a speed, s."""


@dataclass(frozen=True)
class Motion:
    """The motion of one machine in one rollout that ran to its end."""

    machine: Machine
    rollout: Rollout
    trace: Trace
    window: float
    """Length of the scored window, s; rollouts end earlier once everything rests."""

    @cached_property
    def attached(self) -> Flags:
        """(T, N) whether each block is still connected to the root through its parents."""
        attached: Flags = self.trace.alive.copy()
        attached[:, 0] = True
        for step in self.machine.steps[1:]:
            attached[:, step.id] &= attached[:, step.parent]
        return attached

    def blocks(self, types: Sequence[int]) -> list[int]:
        """Ids of the blocks of these types."""
        return [step.id for step in self.machine if step.type in types]

    def term(self, name: str) -> float:
        """A term of the level's score; 0 if it has no value."""
        return float(self.rollout.terms.get(name) or 0.0)

    def path(self, body: int | str) -> Array:
        """(T, 3) centres of a block, by id, or of a moving object of the scene, by name."""
        if isinstance(body, int):
            return self.trace.centre[:, body]
        return self.trace.object_position[:, self.trace.objects.index(body)]

    def distance(self, body: int | str, towards: Direction) -> float:
        """Greatest distance of a body from its place at t = 0 in a direction, m."""
        return float(_along(self.path(body), towards).max())

    def speed(self, body: int | str, towards: Direction) -> float:
        """Greatest mean speed of a body in a direction over one second, m/s."""
        return self._fastest(_along(self.path(body), towards))

    def turned(self, block: int) -> Array:
        """(T,) angle by which a block has turned relative to the root since t = 0, rad; turning
        back adds to it. It stays the same once the block is lost."""
        omega = self.trace.angular_velocity
        relative = np.linalg.norm(omega[:, block] - omega[:, 0], axis=1)
        return self._integral(np.where(self.attached[:, block], relative, 0.0))

    @cached_property
    def spun(self) -> Array:
        """(T,) angle by which the root has turned about the vertical since t = 0, rad, without
        sign; turning back subtracts from it."""
        return np.abs(self._integral(self.trace.angular_velocity[:, 0, 1]))

    def turning_speed(self, block: int) -> float:
        """Greatest mean speed over one second with which a block turns relative to the root,
        rad/s."""
        return self._fastest(self.turned(block))

    @cached_property
    def tilt(self) -> float:
        """Greatest angle between the root's upward axis and its direction at t = 0, degrees."""
        x, y, z, w = np.moveaxis(self.trace.rotation[:, 0], 1, 0)
        up = np.stack([2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)], axis=1)
        return float(np.degrees(np.arccos(np.clip(up @ up[0], -1, 1)).max()))

    @cached_property
    def lift_off(self) -> float:
        """Greatest height by which the whole connected machine was above where its lowest block
        was at t = 0, m: 0 while one block stays down."""
        height = np.where(self.attached, self.trace.centre[:, :, 1], np.inf)
        return float((height.min(axis=1) - height[0].min()).max())

    @cached_property
    def top(self) -> Array:
        """(T,) height of the highest centre of a connected block, m."""
        return np.asarray(np.where(self.attached, self.trace.centre[:, :, 1], -np.inf).max(axis=1))

    def time_while(self, holds: Flags) -> float:
        """Longest time without a break for which a condition, (T,), holds, s.

        A condition that holds at the last sample of a rollout that came to rest holds until the end
        of the window.
        """
        times = np.append(self.trace.times, self.window)
        best, since = 0.0, None
        for index, held in enumerate(holds):
            since = (times[index] if since is None else since) if held else None
            end = times[index + 1] if index == len(holds) - 1 else times[index]
            best = max(best, end - since) if since is not None else best
        return float(best)

    def hardest_hit(self, object_name: str) -> float:
        """Greatest impulse with which a block hit an object, N s; 0 without a touch after t = 0."""
        return max((hit for name, hit in self._hits if name == object_name), default=0.0)

    def touched(self, object_name: str) -> bool:
        """Whether a block touched an object, at t = 0 or later."""
        return any(name == object_name for name, _ in self._hits)

    @cached_property
    def _hits(self) -> list[tuple[int | str, float]]:
        contacts = self.trace.measured.contacts
        return [(item.b, item.hardest.impulse) for item in contacts if isinstance(item.a, int)]

    def _integral(self, rate: Array) -> Array:
        """(T,) integral of a rate, (T,), from t = 0 on, by the trapezoidal rule."""
        steps = np.diff(self.trace.times) * (rate[1:] + rate[:-1]) / 2
        return np.concatenate([[0.0], np.cumsum(steps)])

    def _fastest(self, covered: Array) -> float:
        """Greatest mean rate over `MEAN_OVER` of a covered distance or angle, (T,)."""
        times = self.trace.times
        later = np.interp(times + MEAN_OVER, times, covered)
        return float((later - covered).max() / MEAN_OVER)


def _along(path: Array, towards: Direction) -> Array:
    """(T,) distance of each place from the first one in a direction, m."""
    moved = path - path[0]
    if towards == "any":
        return np.asarray(np.hypot(moved[:, 0], moved[:, 2]))
    return np.asarray(moved[:, "xyz".index(towards[0])] * (1 if towards[1] == "+" else -1))


Body = int | str
"""A block type, of which the block that does best counts, or the name of an object of the scene."""
Amount = Annotated[float, Field(gt=0)]
Asked = Annotated[float, Field(ge=0)]
"""A threshold that asks nothing while it is 0."""
Count = Annotated[int, Field(ge=1)]


class Finding(NamedTuple):
    """A measured value and its threshold, which is inclusive."""

    value: float
    """0 if there was nothing to measure."""
    limit: float
    unit: str
    most: bool = False
    """Whether the limit is the greatest value that passes, rather than the least one."""

    @property
    def passed(self) -> bool:
        """Whether the value keeps the limit."""
        return self.value <= self.limit if self.most else self.value >= self.limit


Findings = Iterator[tuple[str, Finding]]


class FunctionTest(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Base class of function tests: thresholds, what they mean in words, and how they are measured.

    Frozen, range-checked, no unknown keys.
    """

    @abstractmethod
    def phrase(self) -> str:
        """What must happen, for designers, to follow "The machine works if"."""

    @abstractmethod
    def measure(self, motion: Motion) -> Findings:
        """What is measured, by the name of its threshold."""

    def bodies(self) -> tuple[Body, ...]:
        """Block types that a machine needs to pass, and moving objects that the scene needs."""
        return ()

    def obstacles(self) -> tuple[str, ...]:
        """Objects that the scene needs, whether they move or not."""
        return ()


def name_way(towards: Direction) -> str:
    """A direction in words."""
    return "horizontally" if towards == "any" else f"along {towards}"


def name_body(body: Body) -> str:
    """A block type or object in words."""
    if isinstance(body, str):
        return object_label(body)
    return f"its {library()[body].name}" if body == ROOT.type else f"a {library()[body].name}"


def reached_by(count: int, values: Sequence[float]) -> float:
    """What at least `count` of the values reach; 0 if there are fewer values."""
    return sorted(values, reverse=True)[count - 1] if len(values) >= count else 0.0

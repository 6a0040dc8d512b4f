"""The function tests: what must be seen in a rollout for a machine to count as working.

Each test is a group of thresholds, as written in YAML, and compares what it measures with them.
Thresholds are inclusive; those that are left out ask nothing.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from math import inf, pi
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from agentflow.env.rollout import Array
from agentflow.machine.blocks.library import BOULDER, library
from agentflow.training.objectives.motion import Direction, Motion

Body = int | str
"""A block type, of which the block that does best counts, or the name of a thing of the scene."""


class Finding(NamedTuple):
    """A measured value and its threshold."""

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


def required(unit: str) -> Any:
    """A threshold above 0 that must be given."""
    return Field(gt=0, json_schema_extra={"unit": unit})


def optional(unit: str) -> Any:
    """A threshold that asks nothing unless it is given."""
    return Field(0.0, ge=0, json_schema_extra={"unit": unit})


class FunctionTest(BaseModel):
    """Base class of function tests: frozen, range-checked, no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @property
    @abstractmethod
    def phrase(self) -> str:
        """What must happen, for designers, to follow "The machine works if"."""

    @abstractmethod
    def measure(self, motion: Motion) -> Findings:
        """What is measured, by the name of its threshold."""

    @property
    def bodies(self) -> tuple[Body, ...]:
        """Block types and things of the scene that it measures."""
        return ()


class Moves(FunctionTest):
    """The root moves far, or fast."""

    metres: float = required("m")
    towards: Direction = "any"
    speed: float = optional("m/s")

    @property
    def phrase(self) -> str:
        fast = f" and averages at least {self.speed:g} m/s over one second" if self.speed else ""
        return f"its Starting Block moves at least {self.metres:g} m {_way(self.towards)}{fast}"

    def measure(self, motion: Motion) -> Findings:
        yield "metres", Finding(motion.distance(0, self.towards), self.metres, "m")
        if self.speed:
            yield "speed", Finding(motion.speed(0, self.towards), self.speed, "m/s")


class Reaches(FunctionTest):
    """The root comes close to a place on the ground."""

    x: float = 0.0
    z: float
    within: float = required("m")

    @property
    def phrase(self) -> str:
        return (
            f"its Starting Block passes within {self.within:g} m of x = {self.x:g}, "
            f"z = {self.z:g} m"
        )

    def measure(self, motion: Motion) -> Findings:
        path = motion.path(0)
        gap = float(np.hypot(path[:, 0] - self.x, path[:, 2] - self.z).min())
        yield "within", Finding(gap, self.within, "m", most=True)


class Upright(FunctionTest):
    """The root does not tilt."""

    degrees: float = required("degrees")

    @property
    def phrase(self) -> str:
        return f"its Starting Block never tilts by more than {self.degrees:g} degrees"

    def measure(self, motion: Motion) -> Findings:
        yield "degrees", Finding(motion.tilt, self.degrees, "degrees", most=True)


class Whole(FunctionTest):
    """No connection breaks, apart from those that decouplers open."""

    @property
    def phrase(self) -> str:
        return "nothing breaks"

    def measure(self, motion: Motion) -> Findings:
        count = float(len(motion.rollout.broken))
        yield "breakages", Finding(count, 0.0, "connections", most=True)


class Turns(FunctionTest):
    """Blocks turn relative to the root; those of the given types, or all but wheels."""

    revolutions: float = required("revolutions")
    speed: float = optional("rad/s")
    types: tuple[int, ...] = ()
    count: int = Field(1, ge=1)

    @property
    def bodies(self) -> tuple[Body, ...]:
        return self.types

    @property
    def phrase(self) -> str:
        names = " or ".join(library()[kind].name for kind in self.types) or "block, not a wheel,"
        what = f"at least {self.count} of its blocks ({names})" if self.count > 1 else f"a {names}"
        fast = f", at {self.speed:g} rad/s or more over one second" if self.speed else ""
        verb = "turn" if self.count > 1 else "turns"
        return (
            f"{what} {verb} relative to the Starting Block by at least {self.revolutions:g} "
            f"revolutions{fast}"
        )

    def measure(self, motion: Motion) -> Findings:
        blocks = motion.blocks(self.types or _all_but_wheels())
        angles = [float(motion.turned(block)[-1]) / (2 * pi) for block in blocks]
        speeds = [motion.turning_speed(block) for block in blocks]
        least = _rank(angles, self.count)
        yield "revolutions", Finding(least, self.revolutions, "revolutions")
        if self.speed:
            yield "speed", Finding(_rank(speeds, self.count), self.speed, "rad/s")


class Spins(FunctionTest):
    """The root turns about the vertical, and the machine with it."""

    revolutions: float = required("revolutions")

    @property
    def phrase(self) -> str:
        return f"its Starting Block turns {self.revolutions:g} times or more about the vertical"

    def measure(self, motion: Motion) -> Findings:
        turns = float(motion.spun.max()) / (2 * pi)
        yield "revolutions", Finding(turns, self.revolutions, "revolutions")


class Throws(FunctionTest):
    """A boulder leaves the machine in free flight by the rules of `flights.Flight`."""

    metres: float = required("m")
    towards: Literal["z+", "any"] = "z+"
    high: float = optional("m")

    @property
    def bodies(self) -> tuple[Body, ...]:
        return (BOULDER,)

    @property
    def phrase(self) -> str:
        high = f" and rises above {self.high:g} m" if self.high else ""
        return (
            f"a boulder leaves it, flies freely for 0.2 s or more and lands at least "
            f"{self.metres:g} m away {_way(self.towards)}{high}"
        )

    def measure(self, motion: Motion) -> Findings:
        far = motion.term("distance" if self.towards == "z+" else "distance_any")
        yield "metres", Finding(far, self.metres, "m")
        if self.high:
            yield "high", Finding(motion.term("height"), self.high, "m")


class Hits(FunctionTest):
    """A thrown boulder comes down near the target of the level."""

    within: float = required("m")

    @property
    def bodies(self) -> tuple[Body, ...]:
        return (BOULDER,)

    @property
    def phrase(self) -> str:
        return f"its thrown boulder lands within {self.within:g} m of the target"

    def measure(self, motion: Motion) -> Findings:
        miss = motion.rollout.terms.get("target_distance")
        yield "within", Finding(inf if miss is None else float(miss), self.within, "m", most=True)


class Threads(FunctionTest):
    """A thrown boulder passes rings."""

    rings: int = Field(ge=1)

    @property
    def bodies(self) -> tuple[Body, ...]:
        return (BOULDER,)

    @property
    def phrase(self) -> str:
        noun = "ring" if self.rings == 1 else "rings"
        return f"its thrown boulder passes through at least {self.rings} {noun}"

    def measure(self, motion: Motion) -> Findings:
        yield "rings", Finding(motion.term("passed"), self.rings, "rings")


class Raises(FunctionTest):
    """A block or thing is higher than at t = 0 for some time."""

    body: Body
    metres: float = required("m")
    seconds: float = optional("s")

    @property
    def bodies(self) -> tuple[Body, ...]:
        return (self.body,)

    @property
    def phrase(self) -> str:
        time = f" for at least {self.seconds:g} s" if self.seconds else ""
        return f"{_name(self.body)} is {self.metres:g} m or more above its height at t = 0{time}"

    def measure(self, motion: Motion) -> Findings:
        rises = [path[:, 1] - path[0, 1] for path in _paths(motion, self.body)]
        yield "metres", Finding(max((float(r.max()) for r in rises), default=0), self.metres, "m")
        held = [motion.time_while(rise >= self.metres) for rise in rises]
        if self.seconds:
            yield "seconds", Finding(max(held, default=0.0), self.seconds, "s")


class Holds(FunctionTest):
    """A block or thing is above a height for some time."""

    body: Body
    above: float = required("m")
    seconds: float = required("s")

    @property
    def bodies(self) -> tuple[Body, ...]:
        return (self.body,)

    @property
    def phrase(self) -> str:
        return f"{_name(self.body)} stays {self.above:g} m above the ground for {self.seconds:g} s"

    def measure(self, motion: Motion) -> Findings:
        held = [motion.time_while(path[:, 1] >= self.above) for path in _paths(motion, self.body)]
        if self.seconds:
            yield "seconds", Finding(max(held, default=0.0), self.seconds, "s")


class Unfolds(FunctionTest):
    """The highest part of the machine rises."""

    metres: float = required("m")
    seconds: float = optional("s")

    @property
    def phrase(self) -> str:
        time = f" for at least {self.seconds:g} s" if self.seconds else ""
        return f"its highest part rises by at least {self.metres:g} m{time}"

    def measure(self, motion: Motion) -> Findings:
        rise = motion.top - motion.top[0]
        yield "metres", Finding(float(rise.max()), self.metres, "m")
        if self.seconds:
            yield "seconds", Finding(motion.time_while(rise >= self.metres), self.seconds, "s")


class Jumps(FunctionTest):
    """Every part of the machine is off the ground at once."""

    metres: float = required("m")

    @property
    def phrase(self) -> str:
        return (
            f"every part of it is at least {self.metres:g} m above where its lowest part was at "
            "t = 0"
        )

    def measure(self, motion: Motion) -> Findings:
        yield "metres", Finding(motion.lift_off, self.metres, "m")


class Shifts(FunctionTest):
    """A thing of the scene that the machine touched moves."""

    thing: str
    metres: float = required("m")
    towards: Direction = "any"

    @property
    def bodies(self) -> tuple[Body, ...]:
        return (self.thing,)

    @property
    def phrase(self) -> str:
        way = _way(self.towards)
        return f"it touches the {self.thing}, which moves {self.metres:g} m or more {way}"

    def measure(self, motion: Motion) -> Findings:
        far = motion.distance(self.thing, self.towards) if motion.touched(self.thing) else 0.0
        yield "metres", Finding(far, self.metres, "m")


class Strikes(FunctionTest):
    """A block hits a thing of the scene hard."""

    thing: str
    impulse: float = required("N s")

    @property
    def bodies(self) -> tuple[Body, ...]:
        return (self.thing,)

    @property
    def phrase(self) -> str:
        return f"it hits the {self.thing} with an impulse of at least {self.impulse:g} N s"

    def measure(self, motion: Motion) -> Findings:
        yield "impulse", Finding(motion.hardest_hit(self.thing), self.impulse, "N s")


class Avoids(FunctionTest):
    """No block touches a thing of the scene."""

    thing: str

    @property
    def bodies(self) -> tuple[Body, ...]:
        return (self.thing,)

    @property
    def phrase(self) -> str:
        return f"it never touches the {self.thing}"

    def measure(self, motion: Motion) -> Findings:
        yield "touched", Finding(float(motion.touched(self.thing)), 0.0, "", most=True)


class Carries(FunctionTest):
    """Blocks of a type ride along: still attached at the end, and moved."""

    type: int
    count: int = Field(1, ge=1)
    metres: float = required("m")

    @property
    def bodies(self) -> tuple[Body, ...]:
        return (self.type,)

    @property
    def phrase(self) -> str:
        name = library()[self.type].name
        return (
            f"it carries {self.count} or more blocks of type {self.type} ({name}) at least "
            f"{self.metres:g} m from their places without losing them"
        )

    def measure(self, motion: Motion) -> Findings:
        kept = [b for b in motion.blocks([self.type]) if motion.attached[-1, b]]
        far = _rank([motion.distance(block, "any") for block in kept], self.count)
        yield "metres", Finding(far, self.metres, "m")


FUNCTIONS: Mapping[str, type[FunctionTest]] = MappingProxyType(
    {
        "avoids": Avoids,
        "carries": Carries,
        "hits target": Hits,
        "holds": Holds,
        "jumps": Jumps,
        "moves": Moves,
        "passes rings": Threads,
        "raises": Raises,
        "reaches": Reaches,
        "shifts": Shifts,
        "spins": Spins,
        "stays upright": Upright,
        "stays whole": Whole,
        "strikes": Strikes,
        "throws": Throws,
        "turns": Turns,
        "unfolds": Unfolds,
    }
)
"""Function tests by their name in YAML."""


def _way(towards: Direction) -> str:
    return "horizontally" if towards == "any" else f"along {towards}"


def _all_but_wheels() -> tuple[int, ...]:
    return tuple(kind for kind in library() if library()[kind].category != "Wheel")


def _name(body: Body) -> str:
    return f"the {body}" if isinstance(body, str) else f"a {library()[body].name}"


def _rank(values: list[float], count: int) -> float:
    """What at least `count` of the values reach; 0 if there are fewer."""
    return sorted(values, reverse=True)[count - 1] if len(values) >= count else 0.0


def _paths(motion: Motion, body: Body) -> list[Array]:
    """(T, 3) centres of a thing, or of each block of a type that stays attached."""
    if isinstance(body, str):
        return [motion.path(body)]
    return [motion.path(block) for block in motion.blocks([body]) if motion.attached[-1, block]]

"""Function tests of what the machine does to objects: throws, raises, shifts, strikes them."""

from math import inf
from typing import Literal

from agentflow.env.rollout import Array
from agentflow.machine.blocks.library import BOULDER, library
from agentflow.training.objectives.measuring import (
    Amount,
    Asked,
    Body,
    Count,
    Direction,
    Finding,
    Findings,
    FunctionTest,
    Motion,
    name_body,
    name_way,
    reached_by,
)


class _ThrowTest(FunctionTest):
    """A test of what a thrown boulder does."""

    def bodies(self) -> tuple[Body, ...]:
        return (BOULDER,)


class Throws(_ThrowTest):
    """A boulder leaves the machine and flies, by the rules of `flights.Flight`."""

    metres: Amount
    towards: Literal["z+", "any"] = "z+"
    high: Asked = 0.0
    """Greatest height of the boulder's centre above the ground, m."""

    def phrase(self) -> str:
        high = f" after rising to {self.high:g} m or higher" if self.high else ""
        return (
            f"its boulder flies freely for 0.2 s or more and lands at least {self.metres:g} m away "
            f"{name_way(self.towards)}{high}"
        )

    def measure(self, motion: Motion) -> Findings:
        far = motion.term("distance" if self.towards == "z+" else "distance_any")
        yield "metres", Finding(far, self.metres, "m")
        if self.high:
            yield "high", Finding(motion.term("height"), self.high, "m")


class HitsTarget(_ThrowTest):
    """A thrown boulder lands near the target of the level, which must have `score: accuracy`."""

    within: Amount
    """m."""

    def phrase(self) -> str:
        return f"its thrown boulder lands within {self.within:g} m of the target"

    def measure(self, motion: Motion) -> Findings:
        miss = motion.rollout.terms.get("target_distance")
        yield "within", Finding(inf if miss is None else float(miss), self.within, "m", most=True)


class PassesRings(_ThrowTest):
    """A thrown boulder passes rings of the level, which must have `score: rings`."""

    rings: Count

    def phrase(self) -> str:
        noun = "ring" if self.rings == 1 else "rings"
        return f"its thrown boulder passes through at least {self.rings} {noun}"

    def measure(self, motion: Motion) -> Findings:
        yield "rings", Finding(motion.term("passed"), self.rings, "rings")


class Raises(FunctionTest):
    """A block or object is higher than at t = 0, and stays so if asked."""

    body: Body
    metres: Amount
    seconds: Asked = 0.0

    def bodies(self) -> tuple[Body, ...]:
        return (self.body,)

    def phrase(self) -> str:
        time = f" for at least {self.seconds:g} s" if self.seconds else ""
        return f"{name_body(self.body)} is {self.metres:g} m or more higher than at t = 0{time}"

    def measure(self, motion: Motion) -> Findings:
        rises = [path[:, 1] - path[0, 1] for path in _paths(motion, self.body)]
        greatest = max((float(rise.max()) for rise in rises), default=0.0)
        yield "metres", Finding(greatest, self.metres, "m")
        if self.seconds:
            held = [motion.time_while(rise >= self.metres) for rise in rises]
            yield "seconds", Finding(max(held, default=0.0), self.seconds, "s")


class Holds(FunctionTest):
    """A block or object stays above a height."""

    body: Body
    above: Amount
    """Height of its centre, m."""
    seconds: Amount

    def bodies(self) -> tuple[Body, ...]:
        return (self.body,)

    def phrase(self) -> str:
        what = f"{name_body(self.body)} stays at least {self.above:g} m above the ground"
        return f"{what} for at least {self.seconds:g} s"

    def measure(self, motion: Motion) -> Findings:
        held = [motion.time_while(path[:, 1] >= self.above) for path in _paths(motion, self.body)]
        yield "seconds", Finding(max(held, default=0.0), self.seconds, "s")


class Shifts(FunctionTest):
    """An object of the scene that the machine touches moves."""

    thing: str
    metres: Amount
    towards: Direction = "any"

    def bodies(self) -> tuple[Body, ...]:
        return (self.thing,)

    def phrase(self) -> str:
        way = name_way(self.towards)
        return f"it touches {name_body(self.thing)}, which moves {self.metres:g} m or more {way}"

    def measure(self, motion: Motion) -> Findings:
        far = motion.distance(self.thing, self.towards) if motion.touched(self.thing) else 0.0
        yield "metres", Finding(far, self.metres, "m")


class Strikes(FunctionTest):
    """A block hits an object of the scene hard."""

    thing: str
    impulse: Amount
    """N s."""

    def obstacles(self) -> tuple[str, ...]:
        return (self.thing,)

    def phrase(self) -> str:
        return f"it hits {name_body(self.thing)} with an impulse of at least {self.impulse:g} N s"

    def measure(self, motion: Motion) -> Findings:
        yield "impulse", Finding(motion.hardest_hit(self.thing), self.impulse, "N s")


class Avoids(FunctionTest):
    """No block touches an object of the scene."""

    thing: str

    def obstacles(self) -> tuple[str, ...]:
        return (self.thing,)

    def phrase(self) -> str:
        return f"it never touches {name_body(self.thing)}"

    def measure(self, motion: Motion) -> Findings:
        yield "touched", Finding(float(motion.touched(self.thing)), 0.0, "", most=True)


class Carries(FunctionTest):
    """Blocks of a type ride along: they move, and are still attached at the end."""

    type: int
    count: Count = 1
    metres: Amount

    def bodies(self) -> tuple[Body, ...]:
        return (self.type,)

    def phrase(self) -> str:
        name = library()[self.type].name
        return (
            f"{self.count} or more of its blocks of type {self.type} ({name}) move at least "
            f"{self.metres:g} m and stay attached"
        )

    def measure(self, motion: Motion) -> Findings:
        kept = [block for block in motion.blocks([self.type]) if motion.attached[-1, block]]
        far = reached_by(self.count, [motion.distance(block, "any") for block in kept])
        yield "metres", Finding(far, self.metres, "m")


def _paths(motion: Motion, body: Body) -> list[Array]:
    """(T, 3) centres of an object, or of each block of a type that stays attached."""
    if isinstance(body, str):
        return [motion.path(body)]
    return [motion.path(block) for block in motion.blocks([body]) if motion.attached[-1, block]]

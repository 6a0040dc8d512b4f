"""Function tests of how the machine itself moves: away, round, up, upright, in one piece."""

from math import pi

import numpy as np

from agentflow.machine.blocks.library import library
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
    name_way,
    reached_by,
)


class Moves(FunctionTest):
    """The root moves far, and fast if asked."""

    metres: Amount
    towards: Direction = "any"
    speed: Asked = 0.0
    """m/s, mean of the fastest second."""

    def phrase(self) -> str:
        fast = f" and averages at least {self.speed:g} m/s over one second" if self.speed else ""
        return f"its Starting Block moves at least {self.metres:g} m {name_way(self.towards)}{fast}"

    def measure(self, motion: Motion) -> Findings:
        yield "metres", Finding(motion.distance(0, self.towards), self.metres, "m")
        if self.speed:
            yield "speed", Finding(motion.speed(0, self.towards), self.speed, "m/s")


class Reaches(FunctionTest):
    """The root's centre comes close to a place, measured horizontally."""

    x: float = 0.0
    z: float
    within: Amount
    """m."""

    def phrase(self) -> str:
        place = f"x = {self.x:g}, z = {self.z:g} m"
        return f"its Starting Block passes within {self.within:g} m of {place}"

    def measure(self, motion: Motion) -> Findings:
        path = motion.path(0)
        gap = float(np.hypot(path[:, 0] - self.x, path[:, 2] - self.z).min())
        yield "within", Finding(gap, self.within, "m", most=True)


class StaysUpright(FunctionTest):
    """The root's upward axis keeps its direction."""

    degrees: Amount

    def phrase(self) -> str:
        return f"its Starting Block never tilts by more than {self.degrees:g} degrees"

    def measure(self, motion: Motion) -> Findings:
        yield "degrees", Finding(motion.tilt, self.degrees, "degrees", most=True)


class StaysWhole(FunctionTest):
    """No connection breaks; decouplers that let go break nothing."""

    def phrase(self) -> str:
        return "nothing breaks"

    def measure(self, motion: Motion) -> Findings:
        count = float(len(motion.rollout.broken))
        yield "breakages", Finding(count, 0.0, "connections", most=True)


class Turns(FunctionTest):
    """Blocks turn relative to the root: those of the given types, or of any but wheels."""

    revolutions: Amount
    speed: Asked = 0.0
    """rad/s, mean of the fastest second."""
    types: tuple[int, ...] = ()
    count: Count = 1

    def bodies(self) -> tuple[Body, ...]:
        return self.types

    def phrase(self) -> str:
        names = " or ".join(library()[kind].name for kind in self.types)
        what = names or "block that is not a wheel"
        who = f"at least {self.count} blocks ({what}) turn" if self.count > 1 else f"a {what} turns"
        fast = f", at {self.speed:g} rad/s or more over one second" if self.speed else ""
        return f"{who} {self.revolutions:g} times or more relative to its Starting Block{fast}"

    def measure(self, motion: Motion) -> Findings:
        blocks = motion.blocks(self.types or _all_but_wheels())
        turns = [float(motion.turned(block)[-1]) / (2 * pi) for block in blocks]
        yield "revolutions", Finding(reached_by(self.count, turns), self.revolutions, "revolutions")
        if self.speed:
            speeds = [motion.turning_speed(block) for block in blocks]
            yield "speed", Finding(reached_by(self.count, speeds), self.speed, "rad/s")


class Spins(FunctionTest):
    """The root turns about the vertical, and with it the machine."""

    revolutions: Amount

    def phrase(self) -> str:
        return f"its Starting Block turns {self.revolutions:g} times or more about the vertical"

    def measure(self, motion: Motion) -> Findings:
        turns = float(motion.spun.max()) / (2 * pi)
        yield "revolutions", Finding(turns, self.revolutions, "revolutions")


class Jumps(FunctionTest):
    """Every part of the machine is off the ground at once."""

    metres: Amount

    def phrase(self) -> str:
        return (
            f"all of its parts are at the same time at least {self.metres:g} m above where its "
            "lowest part "
            "was at t = 0"
        )

    def measure(self, motion: Motion) -> Findings:
        yield "metres", Finding(motion.lift_off, self.metres, "m")


class Unfolds(FunctionTest):
    """The highest part of the machine rises, and stays up if asked."""

    metres: Amount
    seconds: Asked = 0.0

    def phrase(self) -> str:
        time = f" for at least {self.seconds:g} s" if self.seconds else ""
        return f"its highest part is {self.metres:g} m or more higher than at t = 0{time}"

    def measure(self, motion: Motion) -> Findings:
        rise = motion.top - motion.top[0]
        yield "metres", Finding(float(rise.max()), self.metres, "m")
        if self.seconds:
            yield "seconds", Finding(motion.time_while(rise >= self.metres), self.seconds, "s")


def _all_but_wheels() -> tuple[int, ...]:
    return tuple(kind for kind in library() if library()[kind].category != "Wheel")

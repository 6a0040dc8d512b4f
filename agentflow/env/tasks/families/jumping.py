"""The jumping family: get over walls or a trench without touching them, in ten trials."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from agentflow.env.feedback.clearance import flight_of_root, least_height_over
from agentflow.env.feedback.compose import compose
from agentflow.env.feedback.separation import (
    describe_release,
    is_root_alone,
    root_velocity,
    sample_at,
)
from agentflow.env.feedback.text import block_name, number, object_label, series
from agentflow.env.rollout import Broken, Feedback, Moment, RolloutEvent, Trace, Verdict
from agentflow.env.scene import Scene, Start, blocks_among
from agentflow.env.tasks.base import Parameters, Schedule, WorldView
from agentflow.env.tasks.family import TRIALS, CommonKnobs, TrialFamily, vary
from agentflow.env.tasks.features.barriers import WIDTH, Slope, Trench, Walls
from agentflow.env.tasks.knobs import knob
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.geometry.vectors import inverse, rotate_vector
from agentflow.machine.tree import Machine

BLOCKS = (0, 1, 2, 5, 7, 9, 15, 16, 22, 28, 35, 41, 63, 87)
LEAST_RISE = 1.0
"""Least upward speed of the centre of mass that counts as a jump, m/s."""
HALF = 0.5
"""Share of the machine's mass that must get across."""


class JumpVariation(Parameters):
    """Largest deviation of a trial from the level, in either direction."""

    distance: float = knob(1, 0, 3, "m", "variation of the obstacles' z")
    height: float = knob(0.1, 0, 0.5, "", "relative variation of wall height or trench depth")
    friction: float = knob(0.1, 0, 0.5, "", "relative variation of friction")
    yaw: float = knob(2, 0, 10, "degrees", "variation of the machine's yaw")


class JumpingKnobs(CommonKnobs):
    """Knobs of a jumping level."""

    walls: Walls = Walls()
    trench: Trench = Trench()
    slope: Slope = Slope()
    friction: float = knob(0.8, 0.1, 2, "", "friction coefficient of ground and obstacles")
    yaw: float = knob(0, -10, 10, "degrees", "initial yaw of the machine; positive towards x+")
    jump_at: float = knob(1, 0, 10, "s", "added to schedule.springs and schedule.steering_hinges")
    variation: JumpVariation = JumpVariation()

    @property
    def trials(self) -> int:
        return TRIALS

    @property
    def control_schedule(self) -> Schedule:
        """Springs and steering hinges are delayed by `jump_at`."""
        times, wait = self.schedule, self.jump_at
        return Schedule(times.motors, wait + times.springs, wait + times.steering_hinges)

    @property
    def obstacle(self) -> Walls | Trench:
        """The trench if there is one, else the walls."""
        return self.trench if self.trench.length else self.walls

    @property
    def base(self) -> float:
        """Height of the ground that the machine starts on, m."""
        return self.trench.depth if self.trench.length else 0.0


@dataclass(frozen=True)
class Jumping(TrialFamily):
    """Score: number of successful trials out of ten.

    A trial succeeds if no block touches an obstacle (a wall; a trench's floor or far wall) from
    t = 0 on, and at the end the centres of the root and of at least half of the machine's mass lie
    beyond the far side of the last obstacle. At t = 0 the whole machine must be on the near side
    of the first one.
    """

    family: ClassVar[str] = "jumping"
    knobs: ClassVar[type[CommonKnobs]] = JumpingKnobs
    parameters: JumpingKnobs

    def draw(self, rng: random.Random) -> dict[str, Any]:
        """Vary position and height of the obstacles, friction, and the machine's yaw."""
        knobs, by = self.parameters, self.parameters.variation
        shift = round(rng.uniform(-by.distance, by.distance), 3)
        walls, trench = knobs.walls, knobs.trench
        first = {"first": walls.first + shift, "height": vary(rng, walls.height, by.height)}
        at = {"at": trench.at + shift, "depth": vary(rng, trench.depth, by.height)}
        obstacle = (
            {"trench": trench.model_copy(update=at)}
            if trench.length
            else {"walls": walls.model_copy(update=first)}
        )
        changed = {
            **obstacle,
            "friction": vary(rng, knobs.friction, by.friction),
            "yaw": knobs.yaw + round(rng.uniform(-by.yaw, by.yaw), 3),
        }
        return {"parameters": knobs.model_copy(update=changed)}

    @property
    def brief(self) -> Brief:
        return replace(self.tell("jumping", BLOCKS, wide=WIDTH), greatest=float(TRIALS))

    def scene(self, machine: Machine | None = None) -> Scene:  # noqa: ARG002
        """Walls, or a trench between raised banks; slope and wind."""
        knobs, friction = self.parameters, self.parameters.friction
        objects = (
            *knobs.obstacle.objects(friction),
            *knobs.slope.objects(knobs.obstacle.near_side, knobs.base, friction),
        )
        start = Start(knobs.base, yaw=knobs.yaw)
        return Scene(objects, knobs.wind.velocity, start=start, friction=friction)

    def _flight_text(self, machine: Machine, trace: Trace) -> str:
        """From when to when the root's part of the machine flew; "" with a slope to stand on."""
        if self.parameters.slope.angle:
            return ""
        found = flight_of_root(machine, trace, self.parameters.base)
        if found is None:
            return ", never off the ground with all blocks joined to it"
        return f", off the ground from {number(found[0])} to {number(found[1])} s"

    @property
    def _conditions(self) -> str:
        """What differs from trial to trial, as values of this one."""
        knobs = self.parameters
        return (
            f"{knobs.obstacle.condition}, friction {number(knobs.friction)}, turned by "
            f"{number(abs(knobs.yaw), 1)} degrees to the {'right' if knobs.yaw > 0 else 'left'}"
        )

    def referee(self, machine: Machine) -> JumpReferee:
        return JumpReferee(machine, self.parameters)

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """Outcome of the trial and path of the root."""
        terms = verdict.terms
        top = trace.centre[:, 0, 1]
        moment, velocity, what = verdict.moment, root_velocity(machine, trace), ""
        if moment and is_root_alone(machine, trace, sample_at(trace, moment.time)):
            what = " of the root's fragment"
        take_off_line, data = describe_release(machine, trace, moment, velocity, what)
        lines = (
            f"Result: {terms['outcome']}",
            f"Conditions: {self._conditions}",
            *take_off_line,
            f"Root: greatest height {number(top.max())} m at "
            f"{trace.times[int(top.argmax())]:.2f} s, ends at z = "
            f"{number(trace.centre[-1, 0, 2])} m{self._flight_text(machine, trace)}",
        )
        path = series("Root position", trace.even.times, trace.even.centre[:, 0])
        return compose(machine, trace, broken, verdict, "", lines, data, (path,))


class JumpReferee:
    """Watches for touches of the obstacles, and checks positions at the end."""

    def __init__(self, machine: Machine, knobs: JumpingKnobs) -> None:
        self._machine = machine
        self._obstacle, self._far = knobs.obstacle, knobs.obstacle.far_side
        self._early: int | None = None
        """A block that was already across at t = 0."""
        self._touch: tuple[float, int, str, float] | None = None
        """First touch: time (s), block, obstacle, and how much the block was short by (m)."""
        self._cleared: dict[str, float] = {}
        """By how much the lowest block passed over each wall, m; without walls that none passed."""

    def start(self, world: WorldView) -> None:
        """Check that no block is across yet."""
        self._world, near = world, self._obstacle.near_side
        blocks = [step.id for step in self._machine if not step.two_ended]
        self._early = next((i for i in blocks if world.centre(i)[2] > near), None)
        self.watch(world)

    def watch(self, world: WorldView) -> None:
        """Look for the first touch."""
        for name in self._obstacle.watched:
            if self._touch is None and (blocks := blocks_among(world.touching(name))):
                self._touch = world.time, blocks[0], name, self._missed_by(world, blocks[0])

    def _missed_by(self, world: WorldView, block: int) -> float:
        """Missing height (walls) or distance (trench) of the block, m."""
        if isinstance(self._obstacle, Walls):
            return max(0.0, self._obstacle.height - lowest_point(world, self._machine, block))
        return max(0.0, self._far - world.centre(block)[2])

    def verdict(self, trace: Trace) -> Verdict:
        """Whether and how the trial succeeded or failed."""
        root = self._world.centre(0)[2]
        share = self._share_beyond()
        self._measure_clearance(trace)
        success, outcome, miss = self._judge(root, share)
        touch_time, _, touched, _ = self._touch or (None, None, None, None)
        terms: dict[str, float | bool | str | None] = {
            "success": success,
            "outcome": outcome,
            "miss": miss,
            "root_beyond": root - self._far,
            "mass_beyond": share,
            "touched": touched,
            "touch_time": touch_time,
            "far_side": self._far,
            **{f"clearance, {name}": height for name, height in self._cleared.items()},
        }
        return Verdict(float(success), terms, self._events(), take_off(self._machine, trace))

    def _share_beyond(self) -> float:
        masses = [library()[step.type].mass for step in self._machine]
        beyond = [self._world.centre(step.id)[2] > self._far for step in self._machine]
        return sum(m for m, over in zip(masses, beyond, strict=True) if over) / sum(masses)

    def _measure_clearance(self, trace: Trace) -> None:
        if not isinstance(self._obstacle, Walls):
            return
        for name, place in zip(self._obstacle.watched, self._obstacle.places, strict=True):
            if (lowest := least_height_over(self._machine, trace, place)) is not None:
                self._cleared[name] = lowest - self._obstacle.height

    def _judge(self, root: float, share: float) -> tuple[bool, str, float | None]:
        """Whether the trial succeeded, how near it came in words, and what it missed by, m."""
        beyond = root - self._far
        where = "beyond" if beyond > 0.0 else "short"
        root_text = f"root ends {number(abs(beyond))} m {where}"
        mass_text = f"{share:.0%} of the mass across"
        failed, near, miss = self._find_faults()
        (near if beyond > 0.0 else failed).append(root_text)
        (near if share >= HALF - 1e-9 else failed).append(mass_text)
        if not failed:
            return True, f"success, {', '.join(near)}", None
        told = "; but ".join(", ".join(parts) for parts in (failed, near) if parts)
        return False, f"failed, {told}", max(0.0, -beyond) if miss == 0.0 else miss

    def _find_faults(self) -> tuple[list[str], list[str], float | None]:
        """What failed on the way, which walls were cleared, and what was missed by, m; 0 if
        nothing failed, None if that is no distance."""
        over = [
            f"{name} by {number(height)} m"
            for name, height in self._cleared.items()
            if height > 0.0 and not (self._touch and self._touch[2] == name)
        ]
        cleared = [f"cleared {', '.join(over)}"] if over else []
        if self._early is not None:
            early = block_name(self._machine, self._early)
            return [f"{early} was across before t = 0"], cleared, None
        if self._touch is None:
            return [], cleared, 0.0
        time, block, name, miss = self._touch
        touched = f"{block_name(self._machine, block)} touched {object_label(name)}"
        what = "too low" if isinstance(self._obstacle, Walls) else "short"
        return [f"{touched} at {number(time)} s, {number(miss)} m {what}"], cleared, miss

    def _events(self) -> tuple[RolloutEvent, ...]:
        if self._touch is None:
            return ()
        time, block, name, _ = self._touch
        text = f"{block_name(self._machine, block)} touches {object_label(name)}"
        return (RolloutEvent(time, "obstacle_touched", (block,), text),)


def take_off(machine: Machine, trace: Trace) -> Moment | None:
    """When the centre of mass of what stays with the root rises fastest: from then on, gravity
    alone acts."""
    rise = root_velocity(machine, trace)[:, 1]
    fastest = int(rise.argmax())
    if rise[fastest] < LEAST_RISE:
        return None
    return Moment(float(trace.times[fastest]), "take-off")


def lowest_point(world: WorldView, machine: Machine, block: int) -> float:
    """Height of the lowest corner of a block's box, m; for a two-ended block, of its centre."""
    size = library()[machine[block].type].size
    height = world.centre(block)[1]
    if size is None:
        return height
    down = rotate_vector(inverse(world.rotation(block)), (0.0, 1.0, 0.0))
    return height - sum(abs(axis) * side / 2 for axis, side in zip(down, size, strict=True))

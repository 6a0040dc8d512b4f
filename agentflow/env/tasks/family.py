"""What task families share: common knobs, walls, repeated trials, and their sentences."""

import random
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import cos, sin
from typing import Any, ClassVar, Literal

from agentflow.env.constants import constants
from agentflow.env.controllers.rate import RATE
from agentflow.env.physics.engines import engine_limits
from agentflow.env.scene import SceneObject
from agentflow.env.tasks.base import Parameters, Schedule, Task
from agentflow.env.tasks.knobs import RequirementKnobs, choice, knob
from agentflow.files.templates import fill
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief, Limits
from agentflow.machine.formats.parse import MAX_BLOCKS
from agentflow.machine.geometry.vectors import Vec3, about_axis

WOOD = (0.71, 0.53, 0.34, 1.0)
TRIALS = 10
"""Of a task for which something is drawn."""


class Wind(Parameters):
    """A steady wind."""

    speed: float = knob(0, -20, 20, "m/s", "headwind, towards z-")
    down: float = knob(0, -20, 20, "m/s", "downward wind, towards y-")
    cross: float = knob(0, -20, 20, "m/s", "crosswind, towards x+")

    @property
    def velocity(self) -> Vec3:
        """Velocity of the air, m/s, game frame."""
        return (self.cross, 0.0 - self.down, 0.0 - self.speed)

    def sentences(self) -> tuple[str, ...]:
        """Description for designers; () in still air."""
        named = (
            (self.speed, "z-", "z+"),
            (self.down, "y- (downward)", "y+ (upward)"),
            (self.cross, "x+", "x-"),
        )
        parts = [
            f"{abs(v):g} m/s towards {plus if v > 0 else minus}" for v, plus, minus in named if v
        ]
        return (f"From t = 0 on a steady wind blows: {' and '.join(parts)}.",) if parts else ()


class StartTimes(Parameters):
    """When actuators start."""

    motors: float = knob(0, 0, 60, "s", "start time of wheels, rotating and steering blocks")
    springs: float = knob(0, 0, 60, "s", "start time of springs and winches")
    steering_hinges: float = knob(0, 0, 60, "s", "start time of steering hinges")


class BlockBudget(Parameters):
    """How many blocks a machine may have, and of which types."""

    max: int = knob(
        40, 0, MAX_BLOCKS, "blocks", "most blocks of a machine, without given ones; 0: no limit"
    )
    without: tuple[int, ...] = choice(
        (),
        "a list of block types",
        "block types that the machine may not have, of those that the family allows",
    )


class Sensing(Parameters):
    """How well machines with controllers sense."""

    noise: float = knob(0, 0, 0.5, "", "noise of sensors, as a share of what they read")
    delay: int = knob(0, 0, 20, "", "by how many readings, 30 in a second, sensors are late")


class CommonKnobs(Parameters):
    """Knobs that every family has."""

    window: float = knob(5, 1, 60, "s", "length of the scored window")
    """Length of the scored window, s."""
    schedule: StartTimes = StartTimes()
    """When motors, springs and steering hinges start."""
    wind: Wind = Wind()
    """Wind and its gusts."""
    blocks: BlockBudget = BlockBudget()
    """How many blocks, and which of them are withheld."""
    controls: Literal["schedule", "designed", "sensed"] = choice(
        "schedule",
        "schedule, designed or sensed",
        "what switches blocks: the level's schedule, control programs of machines, or these and "
        "controllers, which sense",
    )
    sensing: Sensing = Sensing()
    """How well machines sense."""
    requirements: RequirementKnobs = RequirementKnobs()
    """What machines must keep besides."""

    @property
    def trials(self) -> int:
        """Rollouts of an evaluation; 1 unless something is drawn for each."""
        return 1

    @property
    def control_schedule(self) -> Schedule:
        """The control schedule of the level."""
        times = self.schedule
        return Schedule(times.motors, times.springs, times.steering_hinges)


@lru_cache(256)  # briefs are read often, mostly those of a few levels
def sentences(template: str, /, **known: object) -> Mapping[str, tuple[str, ...]]:
    """What a file in `templates` tells of a level, by heading; each line is a sentence."""
    _, *parts = re.split(
        r"^# (\w+)\n", fill("agentflow.env.tasks", template, **known), flags=re.MULTILINE
    )
    return {
        heading: tuple(filter(None, map(str.strip, text.splitlines())))
        for heading, text in zip(parts[::2], parts[1::2], strict=True)
    }


def schedule_sentences(
    schedule: Schedule, window: float, blocks: Collection[int], sensing: Sensing | None = None
) -> tuple[str, ...]:
    """Describe the control schedule.

    Args:
        schedule: Start times.
        window: Length of the scored window, s.
        blocks: Block types that the task allows.
        sensing: How well machines sense; None if they have no controllers.
    """
    types = [library()[kind] for kind in sorted(blocks)]
    motors = sorted(types, key=lambda block: (not block.powered_wheel, -block.type))
    turning = list(dict.fromkeys(block.motor_name for block in motors if block.motor_name))
    groups = frozenset(block.group for block in types)
    starts = {
        "motors and thrusters": (schedule.motors, {"motors", "thrusters"}),
        "springs and winches": (schedule.springs, {"springs", "winches"}),
        "steering hinges": (schedule.steering_hinges, {"steering_hinges"}),
    }
    there = {name: time for name, (time, own) in starts.items() if own & groups}
    if len(set(there.values())) == 1:
        there = {"all of them": next(iter(there.values()))}
    texts = (block.schedule_text.format(**vars(schedule)) for block in types if block.schedule_text)
    return sentences(
        "schedule",
        schedule=schedule,
        window=window,
        groups=groups,
        motors=" and ".join(filter(None, (", ".join(turning[:-1]), *turning[-1:]))),
        starts=", ".join(f"{name} start at t = {time:g} s" for name, time in there.items()),
        more="\n".join(texts),
        sensing=sensing,
        rate=RATE,
    )["schedule"]


GROUND = (
    "The ground is flat, at y = 0; z+ is the target direction.",
    "The machine starts with the centre of its bounding box above x = z = 0 and its lowest point "
    "on the ground.",
)
"""First sentences of most scenes."""


def wall(
    name: str, x: float, z: float, size: Vec3, friction: float | None = None, base: float = 0.0
) -> SceneObject:
    """A box of full extents `size` that stands at height `base`, centred over (x, z); m."""
    position = (x, base + size[1] / 2, z)
    return SceneObject(name, "box", size, position, friction=friction, color=WOOD)


def tilted_plate(
    name: str, size: Vec3, top: tuple[float, float], pitch: float, friction: float | None = None
) -> SceneObject:
    """A plate of full extents `size` (m) whose z+ end is raised by `pitch` (rad).

    `top` holds y and z of the middle of its upper side.
    """
    half = size[1] / 2
    place = (0.0, top[0] - half * cos(pitch), top[1] + half * sin(pitch))
    turn = about_axis((-1.0, 0.0, 0.0), pitch)
    return SceneObject(name, "box", size, place, turn, friction=friction, color=WOOD)


@dataclass(frozen=True)
class Family(Task):
    """A task whose parameters include the common knobs.

    A family sets `family`, `knobs` and its parameters. What else other parts of the package need
    to know of it has a default.
    """

    knobs: ClassVar[type[CommonKnobs]]
    """The class of its knobs."""
    drives: ClassVar[bool] = False
    """Whether its machines drive along z: powered wheels must then turn about x."""
    stays: ClassVar[bool] = False
    """Whether its machines stay in place, so that one that does not move is not a failure."""
    symmetric: ClassVar[bool] = False
    """Whether its scores tell left from right only where the scene does."""
    performance: ClassVar[str | None] = None
    """Term of its score that is the reward of reinforcement learning; None: the score over the
    level's good score."""
    ranked: ClassVar[bool] = False
    """Whether comparisons of engines rank machines of the procedural model, whose mechanisms for
    the family should then have many dimensions."""
    diagnosed: ClassVar[bool] = False
    """Whether questions about machines are asked about designs for its first level; questions are
    drawn from all such families, so one more changes them."""
    similar: ClassVar[float] = 0.5
    """A text whose TF-IDF cosine with a sentence of its briefs is this or more says the same:
    paraphrases of our briefs reach 0.52 to 0.83, our own design objectives at most 0.48."""
    parameters: CommonKnobs
    """The values of the knobs of this task."""
    trial: int = 0
    """Number of this trial, from 1; 0 is the whole task."""

    def trials(self, seed: int) -> tuple[Task, ...]:
        """The trials of this seed, the same for every machine; one if nothing is drawn for them."""
        count = self.parameters.trials
        if self.trial or count == 1:
            return (self,)
        rng = random.Random(f"{seed}/trials/{self.family}")
        return tuple(replace(self, trial=i, **self.draw(rng)) for i in range(1, count + 1))

    def draw(self, rng: random.Random) -> dict[str, Any]:
        """What differs in a trial from the level, by name of the attribute; families whose levels
        have trials say it."""
        raise NotImplementedError(f"{type(self).__name__}.draw")

    @property
    def limits(self) -> Limits:
        """What bounds a machine: the level's budget of blocks, the engine, and until when it may
        bring controls."""
        limits = replace(engine_limits(self.engine), blocks=self.parameters.blocks.max or None)
        window = self.window if self.schedule.designed else None
        return replace(limits, controls=window, senses=self._senses, trials=self.schedule.trials)

    @property
    def _senses(self) -> bool:
        return self.parameters.controls == "sensed"

    @property
    def sensing(self) -> tuple[float, int]:
        """As in `Task`."""
        return self.parameters.sensing.noise, self.parameters.sensing.delay

    def tell(self, template: str, blocks: Collection[int], **known: object) -> Brief:
        """The brief of a level, with the sentences of a file in `env/tasks/templates`.

        Args:
            template: Its name, without `.j2`.
            blocks: Types that the family allows.
            known: What it names, besides the knobs and the window.
        """
        knobs = self.parameters
        told = sentences(
            template,
            knobs=knobs,
            window=self.window,
            trials=TRIALS,
            ground="\n".join(GROUND),
            wind="\n".join(knobs.wind.sentences()),
            settle_most=constants()["settle_most"],
            **known,
        )
        (objective,), schedule = told["objective"], told.get("schedule")
        return self.describe(blocks, objective, told["scene"], told["score"], schedule)

    def describe(
        self,
        blocks: Collection[int],
        objective: str,
        scene: Iterable[str],
        score: Iterable[str],
        schedule: Iterable[str] | None = None,
    ) -> Brief:
        """The brief of a level: its sentences with the types, limits and schedule that it allows.

        Args:
            blocks: Types that the family allows.
            objective: As in `Brief`.
            scene: As in `Brief`.
            score: As in `Brief`.
            schedule: As in `Brief`; by default, when motors, springs and steering hinges start.
        """
        allowed, requirements = self.allow(blocks), self.parameters.requirements.all
        if schedule is None or self.schedule.designed:
            sensing = self.parameters.sensing if self._senses else None
            schedule = schedule_sentences(self.schedule, self.window, allowed, sensing)
        return Brief(
            name=self.name,
            objective=objective,
            scene=tuple(scene),
            schedule=tuple(schedule),
            score=(*score, *requirements.sentences(allowed)),
            blocks=tuple(sorted(allowed)),
            limits=self.limits,
            symmetric=self._is_mirrored,
            requirements=requirements,
        )

    @cached_property
    def _is_mirrored(self) -> bool:
        """Whether mirror images score alike; briefs are read often, and some scenes have hundreds
        of objects."""
        return self.symmetric and self.scene().symmetric

    def allow(self, blocks: Collection[int]) -> tuple[int, ...]:
        """The block types of a family that the level allows."""
        return tuple(kind for kind in blocks if kind not in self.parameters.blocks.without)


class TrialFamily(Family):
    """A task whose requirements apply to its trials together, not to each of them."""


def vary(rng: random.Random, value: float, share: float) -> float:
    """Scale a value by a random factor of 1 - share to 1 + share; rounded to 3 decimals."""
    return round(value * rng.uniform(1.0 - share, 1.0 + share), 3)

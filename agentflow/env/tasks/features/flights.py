"""Owns flights of a boulder: what tells a throw from a boulder that is carried, pushed or rolls.

What a throw is worth is throwing.py's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot

import numpy as np

from agentflow.env.constants import constants
from agentflow.env.feedback import block_name, number
from agentflow.env.rollout import Event
from agentflow.env.scene import Vec3
from agentflow.env.tasks.base import Body, World
from agentflow.env.tasks.features.rings import Passage, Ring
from agentflow.machine.tree import Machine

FREE_FLIGHT = 0.2
"""Seconds without contact that make a flight (spec 3)."""
NEAR = 0.25
"""The root may not be within this share of the distance at the landing (spec 3)."""
STILL = 0.1
"""Metres along z+ that a machine which stands may move: by recoil, or as it settles."""
RL_HEIGHT = 3.0
"""Metres that the boulder must exceed for the reinforcement-learning score (spec 3)."""
ROUNDING = 1e-6
"""Seconds by which summed steps may miss a limit."""


@dataclass(frozen=True)
class Landing:
    """The first touch of ground or wall after free flight; metres and seconds."""

    time: float
    surface: str
    place: Vec3
    forward: float
    any: float
    from_root: float
    flown: float
    """Along z+ since it left the machine."""
    driven: float
    """By the root in that time."""

    @property
    def index(self) -> int:
        """The first of the usual samples at or after the touch."""
        return int(np.ceil(self.time / constants()["sample_interval"] - ROUNDING))

    @property
    def distance(self) -> float:
        """What counts along z+: nothing when the machine that it left drove on farther."""
        return 0.0 if self.rolled_off else self.counted(self.forward)

    @property
    def rolled_off(self) -> bool:
        """Whether the machine drove on farther than the boulder flew."""
        return self.driven > max(self.flown, STILL)

    def counted(self, distance: float) -> float:
        """The distance, 0 where it is negative or the root has come along."""
        return max(0.0, distance) if self.from_root >= NEAR * distance else 0.0


class Flight:
    """Follows a boulder's centre and contacts step by step until it lands.

    A throw: the boulder leaves the machine, touches nothing for at least 0.2 s, and then lands,
    which is its first touch of ground or wall. The flight must begin at the machine: once the
    boulder has touched ground or wall without that, only a new touch of the machine that lifts it
    off again can begin a flight. It counts nothing when the root's centre is then horizontally
    (x, z) nearer to the boulder's than a quarter of the distance, or when the root has moved
    farther along z+ than the boulder since it left: then it was not thrown but rolled off.
    """

    def __init__(self, machine: Machine, boulder: int, rings: Sequence[Ring] = ()) -> None:
        self._machine, self._rings = machine, rings
        self.boulder = boulder
        self._origin: Vec3 = (0.0, 0.0, 0.0)
        self.height = self.height_time = self.reach = 0.0
        self._holder: int | None = None
        self._left: float | None = None
        """Last moment at which the boulder touched the machine."""
        self._from = (0.0, 0.0)
        """z of boulder and root then, m."""
        self._clean = False
        """Whether it has touched neither ground nor wall since then."""
        self._rolled = False
        self.landing: Landing | None = None
        self.passage = Passage(rings)
        """Since the boulder last touched anything."""

    @property
    def distance(self) -> float:
        """What the throw counts along z+, m; 0 without one."""
        return self.landing.distance if self.landing else 0.0

    @property
    def left(self) -> float | None:
        """When the boulder last left the machine, s; None while it is held, or if never."""
        return self._left if self.landing or self._rolled else None

    def start(self, world: World) -> None:
        """Remember where the boulder rests and what holds it."""
        self._origin = world.centre(self.boulder)
        self.watch(world)

    def watch(self, world: World) -> None:
        """Keep the greatest height and reach until it lands."""
        if self.landing is not None:
            return
        place = world.centre(self.boulder)
        x, y, z = place
        self.reach = max(self.reach, hypot(x - self._origin[0], z - self._origin[2]))
        if y > self.height:
            self.height, self.height_time = y, world.time
        touching = world.touching(self.boulder)
        if touching:
            self._touch(world, touching)
        if self.landing is None:
            self.passage = Passage(self._rings) if touching else self.passage
            self.passage.watch(place)

    def _touch(self, world: World, touching: frozenset[Body]) -> None:
        blocks = [body for body in touching if isinstance(body, int)]
        scene = sorted(body for body in touching if isinstance(body, str))
        if blocks:
            self._holder, self._left, self._clean = min(blocks), world.time, not scene
            self._from = (world.centre(self.boulder)[2], world.centre(0)[2])
        elif self._clean and world.time - (self._left or 0.0) >= FREE_FLIGHT - ROUNDING:
            self._land(world, scene[0])
        else:
            self._clean, self._rolled = False, True

    def _land(self, world: World, surface: str) -> None:
        place = world.centre(self.boulder)
        x, _, z = place
        root = world.centre(0)
        self.passage.watch(place)
        self.landing = Landing(
            time=world.time,
            surface=surface,
            place=place,
            forward=z - self._origin[2],
            any=hypot(x - self._origin[0], z - self._origin[2]),
            from_root=hypot(x - root[0], z - root[2]),
            flown=z - self._from[0],
            driven=root[2] - self._from[1],
        )

    def away(self, x: float, z: float) -> float | None:
        """How far from a place a throw that counts has landed, horizontally, m; else None."""
        if self.landing is None or not self.distance:
            return None
        return hypot(self.landing.place[0] - x, self.landing.place[2] - z)

    def terms(self) -> dict[str, float | bool | str | None]:
        """Everything about it by name; None where it does not apply."""
        landing = self.landing
        return {
            "distance": self.distance,
            "distance_any": landing.counted(landing.any) if landing else 0.0,
            "height": self.height,
            "height_time": self.height_time,
            "reach": self.reach,
            "rl": self.height * self.distance if self.height > RL_HEIGHT else 0.0,
            "thrown": self.distance > 0.0,
            "left_holder": self.left,
            "landing": landing.time if landing else None,
            "landing_index": landing.index if landing else None,
            "landed_on": landing.surface if landing else None,
            "root_distance": landing.from_root if landing else None,
            "result": self._result(),
        }

    def events(self) -> tuple[Event, ...]:
        """When it left the machine and when it landed; () without a landing."""
        if self.landing is None or self._holder is None or self.left is None:
            return ()
        holder = block_name(self._machine, self._holder)
        ground = f"the boulder lands on the {self.landing.surface}"
        blocks = (self.boulder, self._holder)
        return (
            Event(self.left, "left_holder", blocks, f"the boulder leaves {holder}"),
            Event(self.landing.time, "landing", (self.boulder,), ground),
        )

    def _result(self) -> str:
        landing = self.landing
        if landing is None or self._left is None or self._holder is None:
            return _FAILED[self._rolled, self._left is not None]
        flight = (
            f"the boulder left {block_name(self._machine, self._holder)} at "
            f"{number(self._left)} s and landed on the {landing.surface} at "
            f"{number(landing.time)} s"
        )
        if self.distance > 0.0:
            return f"thrown: {flight}, {number(self.distance)} m along z+"
        if landing.forward <= 0.0:
            return f"thrown the wrong way: {flight}, {number(-landing.forward)} m along z-"
        if landing.rolled_off:
            return (
                f"rolled off: {flight}, {number(landing.flown)} m along z+ in flight, while the "
                f"Starting Block went {number(landing.driven)} m"
            )
        return (
            f"carried: {flight}, {number(landing.forward)} m along z+ with the Starting Block only "
            f"{number(landing.from_root)} m away"
        )


_FAILED = {
    (False, False): "not thrown: the boulder never touched the machine",
    (False, True): "not thrown: the boulder never came down free of the machine",
    (True, False): "not thrown: the boulder lay on the ground and never left from the machine",
    (True, True): f"not thrown: the boulder reached the ground without {FREE_FLIGHT:g} s of free "
    "flight (carried, dropped, pushed or rolled)",
}
"""Keys: whether it rolled, whether it was ever held."""

RULES = (
    "The centre of the boulder is what counts.",
    f"Free flight means no contact with the machine for {FREE_FLIGHT:g} s: a boulder that is "
    "carried, rolls, is pushed along or never leaves the machine scores 0.",
    f"The throw counts only when the Starting Block is not within {NEAR:.0%} of the distance of "
    "the boulder when it lands, and has not moved farther along z+ than the boulder since it left: "
    "a boulder that rolls off while the machine drives on scores 0.",
)
"""The same in words."""

"""Flights of a boulder, and what it passes: rings, cannons."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import dist, hypot

from agentflow.env.feedback.text import block_name, number, object_label
from agentflow.env.rollout import Moment, RolloutEvent
from agentflow.env.scene import Body, blocks_among, objects_among
from agentflow.env.tasks.base import ROUNDING, WorldView
from agentflow.env.tasks.features.rings import Ring, RingProgress
from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import DIRECTIONS
from agentflow.machine.geometry.vectors import Vec3, add, rotate_vector, scale
from agentflow.machine.tree import Machine

EVERY = 0.1
"""Time between looks at what flames heat, s: until something breaks, this never changes."""
MOST = 6
"""Most texts; cannons that fired alike share one."""
LEAST = 0.05
"""Shortest time that is reported, s."""


class CannonWatch:
    """Adds up when the cannons of a machine fire."""

    def __init__(self, machine: Machine) -> None:
        kinds = [(step.id, library()[step.type]) for step in machine]
        self._entries = {
            block: block if machine.controlled else "motors"
            for block, kind in kinds
            if kind.steam is not None
        }
        """What each cannon's level is that of."""
        self._flames = [(block, kind.flame) for block, kind in kinds if kind.flame is not None]
        self._seconds = {block: [0.0, 0.0] for block in self._entries}
        """For how long each cannon fired as steam, and cold, s."""
        self._cold: dict[int, bool] = {}
        """Which cannons no flame heats, when last looked at."""
        self._time = self._due = 0.0

    def watch(self, world: WorldView) -> None:
        """Add the time since the last call."""
        passed, self._time = world.time - self._time, world.time
        if world.time >= self._due - ROUNDING:
            self._due = world.time + EVERY
            self._look(world)
        for block, entry in self._entries.items():
            if world.levels.get(entry):
                self._seconds[block][self._cold[block]] += passed

    def _look(self, world: WorldView) -> None:
        flames = []
        for block, flame in self._flames:
            ahead = scale(DIRECTIONS[flame.direction], flame.reach)
            at = add(world.centre(block), rotate_vector(world.rotation(block), ahead))
            flames.append((at, flame.radius))
        for block in self._entries:
            middle = world.centre(block)
            self._cold[block] = all(dist(middle, at) > radius for at, radius in flames)

    @property
    def text(self) -> str:
        """What each cannon did; "" without cannons."""
        alike: dict[str, list[int]] = {}
        for block, (steam, cold) in self._seconds.items():
            alike.setdefault(_fired_text(steam, cold), []).append(block)
        texts = [f"{', '.join(map(str, blocks))} {text}" for text, blocks in alike.items()]
        if hidden := sum(map(len, list(alike.values())[MOST:])):
            texts[MOST:] = [f"{hidden} more not shown"]
        return "; ".join(texts)


def _fired_text(steam: float, cold: float) -> str:
    """For how long a cannon fired, s."""
    spans = (("as steam", steam), ("cold", cold))
    told = [f"{how} {number(seconds, 1)} s" for how, seconds in spans if seconds >= LEAST]
    return ", ".join(told) or "never fired"


FREE_FLIGHT = 0.2
"""Shortest time without contact that counts as free flight, s."""
NEAR = 0.25
"""Least distance of the root from the landing boulder, as a share of the distance thrown."""
STILL = 0.1
"""Largest motion along z+ of a machine that counts as standing still, m; allows for recoil."""
RL_HEIGHT = 3.0
"""Height that the boulder must exceed for the `rl` score, m."""


@dataclass(frozen=True)
class Landing:
    """The end of a free flight: the first touch of ground or wall (the `surface`), or the end of
    the window. m, s.

    `forward` and `any` are the distances from where the boulder was at t = 0, along z+ and
    horizontal, `from_root` is the horizontal one from the root. Along z+, the boulder has `flown`
    since it left the machine, and the root has `driven` in that time.
    """

    time: float
    surface: str | None
    position: Vec3
    forward: float
    any: float
    from_root: float
    flown: float
    driven: float

    @property
    def distance(self) -> float:
        """Distance along z+ that counts; 0 if the boulder rolled off or was carried."""
        return 0.0 if self.rolled_off else self.count_distance(self.forward)

    @property
    def rolled_off(self) -> bool:
        """Whether the machine drove farther than the boulder flew."""
        return self.driven > max(self.flown, STILL)

    def count_distance(self, distance: float) -> float:
        """The distance; 0 if it is negative or the root is too close to the boulder."""
        return max(0.0, distance) if self.from_root >= NEAR * distance else 0.0


class Flight:
    """Tracks a boulder's centre and contacts step by step until it lands.

    In a throw, the boulder leaves the machine, touches nothing for at least 0.2 s, and lands at
    its first touch of ground or wall. A boulder still in free flight when the window ends counts
    as if it landed there. The flight must start at the machine: a boulder that touched ground or
    wall can only be thrown after the machine has lifted it off again. A throw counts 0 if, at the
    end of the flight, the root's centre is horizontally (x, z) closer to the boulder's than a
    quarter of the distance (carried), or if the root has moved farther along z+ than the boulder
    since it left (rolled off).
    """

    def __init__(self, machine: Machine, boulder: int, rings: Sequence[Ring] = ()) -> None:
        self._machine, self._rings = machine, rings
        self.boulder = boulder
        self._origin: Vec3 = (0.0, 0.0, 0.0)
        self.height = self.height_time = self.reach = 0.0
        self._holder: int | None = None
        self._left: float | None = None
        """Time of the boulder's last contact with the machine, s."""
        self._from = (0.0, 0.0)
        """z of boulder and root at that time, m."""
        self._clean = False
        """Whether the boulder has touched neither ground nor wall since then."""
        self._rolled = False
        self._touching: frozenset[Body] = frozenset()
        self._blocks: list[int] = []
        self._scene: list[str] = []
        """What the boulder touched last, and the blocks and objects among it: in most steps it
        touches the same again."""
        self.landing: Landing | None = None
        self.progress = RingProgress(rings)
        """Rings passed since the boulder last touched anything."""

    @property
    def distance(self) -> float:
        """Distance of the throw along z+, m; 0 without a valid throw."""
        return self.landing.distance if self.landing else 0.0

    @property
    def left(self) -> float | None:
        """Time at which the boulder last left the machine, s; None if it has not."""
        return self._left if self.landing or self._rolled else None

    @property
    def release(self) -> Moment | None:
        """When the boulder left the machine for its flight; None without one."""
        if self.landing is None or self.left is None:
            return None
        return Moment(self.left, "release", self.boulder, self._holder)

    def start(self, world: WorldView) -> None:
        """Record where the boulder rests and what holds it."""
        self._world = world
        self._origin = world.centre(self.boulder)
        self.watch(world)

    def watch(self, world: WorldView) -> None:
        """Update height, reach, rings and landing."""
        if self.landing is not None:
            return
        position = world.centre(self.boulder)
        x, y, z = position
        self.reach = max(self.reach, hypot(x - self._origin[0], z - self._origin[2]))
        if y > self.height:
            self.height, self.height_time = y, world.time
        touching = world.touching(self.boulder)
        if touching:
            self._handle_contact(world, touching, z)
        if self._rings and self.landing is None:
            self.progress = RingProgress(self._rings) if touching else self.progress
            self.progress.move_to(position)

    def _handle_contact(self, world: WorldView, touching: frozenset[Body], z: float) -> None:
        if touching != self._touching:
            self._touching = touching
            self._blocks, self._scene = blocks_among(touching), objects_among(touching)
        blocks, scene = self._blocks, self._scene
        if blocks:
            self._holder, self._left, self._clean = blocks[0], world.time, not scene
            self._from = (z, world.centre(0)[2])
        elif self._flies(world):
            self._land(world, scene[0])
        else:
            self._clean, self._rolled = False, True

    def finish(self) -> None:
        """End of the window: a boulder in free flight counts from where it is."""
        if self.landing is None and self._flies(self._world):
            self._land(self._world, None)

    def _flies(self, world: WorldView) -> bool:
        """Whether the boulder has touched nothing for long enough since it left the machine."""
        return self._clean and world.time - (self._left or 0.0) >= FREE_FLIGHT - ROUNDING

    def _land(self, world: WorldView, surface: str | None) -> None:
        position = world.centre(self.boulder)
        x, _, z = position
        root = world.centre(0)
        self.progress.move_to(position)
        self.landing = Landing(
            time=world.time,
            surface=surface,
            position=position,
            forward=z - self._origin[2],
            any=hypot(x - self._origin[0], z - self._origin[2]),
            from_root=hypot(x - root[0], z - root[2]),
            flown=z - self._from[0],
            driven=root[2] - self._from[1],
        )

    def distance_from(self, x: float, z: float) -> float | None:
        """Horizontal distance of a valid throw's landing from a point, m; None without one."""
        if self.landing is None or self.landing.surface is None or not self.distance:
            return None
        return hypot(self.landing.position[0] - x, self.landing.position[2] - z)

    def terms(self) -> dict[str, float | bool | str | None]:
        """The flight as verdict terms; those that do not apply are None."""
        end = self.landing
        landing = end if end and end.surface else None
        return {
            "distance": self.distance,
            "distance_any": end.count_distance(end.any) if end else 0.0,
            "height": self.height,
            "height_time": self.height_time,
            "reach": self.reach,
            "rl": self.height * self.distance if self.height > RL_HEIGHT else 0.0,
            "thrown": self.distance > 0.0,
            "in_air": end is not None and landing is None,
            "left_holder": self.left,
            "landing": landing.time if landing else None,
            "landed_on": landing.surface if landing else None,
            "root_distance": end.from_root if end else None,
            "result": self._result(),
        }

    def events(self) -> tuple[RolloutEvent, ...]:
        """Events for leaving the machine and landing; () without a flight."""
        if self.landing is None or self._holder is None or self.left is None:
            return ()
        holder = block_name(self._machine, self._holder)
        blocks = (self.boulder, self._holder)
        left = RolloutEvent(self.left, "left_holder", blocks, f"the boulder leaves {holder}")
        if self.landing.surface is None:
            return (left,)
        ground = f"the boulder lands on {object_label(self.landing.surface)}"
        return left, RolloutEvent(self.landing.time, "landing", (self.boulder,), ground)

    def _result(self) -> str:
        landing = self.landing
        if landing is None or self._left is None or self._holder is None:
            return _FAILURES[self._rolled, self._left is not None]
        end = f"was still in the air at the end of the window ({number(landing.time)} s)"
        if landing.surface:
            end = f"landed on {object_label(landing.surface)} at {number(landing.time)} s"
        holder = block_name(self._machine, self._holder)
        flight = f"the boulder left {holder} at {number(self._left)} s and {end}"
        if self.distance > 0.0:
            so_far = "" if landing.surface else " so far"
            return f"thrown: {flight}, {number(self.distance)} m along z+{so_far}"
        if landing.forward <= 0.0:
            return f"thrown the wrong way: {flight}, {number(-landing.forward)} m along z-"
        if landing.rolled_off:
            return (
                f"rolled off: {flight}, {number(landing.flown)} m along z+ in flight, while the "
                f"Starting Block moved {number(landing.driven)} m"
            )
        return (
            f"carried: {flight}, {number(landing.forward)} m along z+ with the Starting Block only "
            f"{number(landing.from_root)} m away"
        )


_FAILURES = {
    (False, False): "not thrown: the boulder never touched the machine",
    (False, True): "not thrown: at the end of the window the boulder had not been free of the "
    f"machine for {FREE_FLIGHT:g} s",
    (True, False): "not thrown: the machine never lifted the boulder off the ground",
    (True, True): f"not thrown: the boulder reached the ground without {FREE_FLIGHT:g} s of free "
    "flight (carried, dropped, pushed or rolled)",
}
"""Keys: whether it rolled, whether it was ever held."""

"""What the worlds of all engines have in common; how a world is built and takes a step is the
engine's own."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from agentflow.env.constants import Constants
from agentflow.env.physics.engine import Touch, Watch
from agentflow.env.physics.frames import swap, swap_quaternion
from agentflow.env.physics.grips import Grips
from agentflow.env.physics.laws.air import GustClock
from agentflow.env.physics.laws.forces import Entry
from agentflow.env.physics.laws.holding import HoldForce
from agentflow.env.physics.laws.ledger import Ledger
from agentflow.env.physics.laws.select import Forces, Law, device_laws, wind_laws
from agentflow.env.physics.laws.tension import SpringForce, WinchForce
from agentflow.env.physics.model import Assembly, State
from agentflow.env.physics.readings import Readings, states_of
from agentflow.env.physics.rows import ROTATION, Row, Rows, centre_of
from agentflow.env.physics.structure.layout import RowLayout
from agentflow.env.physics.structure.spanning_tree import Skeleton, skeleton
from agentflow.env.rollout import Array
from agentflow.env.scene import Body, Scene, SceneObject
from agentflow.machine.geometry.vectors import Quat, Vec3, rotate_vector, subtract

Snapshot = tuple[Readings, Array]
"""Rows, and what reads them."""
Pair = tuple[Body, Body]
"""Two bodies in the order of a touch."""


class Contacts(Protocol):
    """What touched what in the last step."""

    def touching(self, body: Body) -> frozenset[Body]:
        """As `engine.World.touching`."""

    def all(self) -> list[Touch]:
        """As `engine.World.contacts`."""


class Motors(Protocol):
    """The motors of all joints."""

    step: float
    """Length of a step, s."""

    def set(self) -> None:
        """Follow the levels."""


@dataclass(frozen=True)
class UnsplitMachine:
    """The machine until the next split, and the objects that read and drive it."""

    layout: RowLayout
    readings: Readings
    rows: Rows
    contacts: Contacts
    forces: Forces
    motors: Motors


Own = TypeVar("Own", bound=UnsplitMachine)


class BaseWorld(ABC, Generic[Own]):
    """An `engine.World`, see there for its members; a subclass adds `speeds`.

    It sets `now` as it is made, and at each split.
    """

    now: Own
    """What the engine holds until the next split."""
    settle_rate: float
    _grips: Grips[Any]
    """They outlive splits."""

    def __init__(self, physics: Constants, assembly: Assembly, scene: Scene, rate: float) -> None:
        self._physics, self._assembly = physics, assembly
        self._scene = self._unloaded = scene
        self._objects = {item.name: item for item in scene.objects}
        self._rate, self._divisions = rate, 1
        self._interval = 1.0 / rate
        """Length of a step, s."""
        self._broken: frozenset[int] = frozenset()
        self._levels: dict[Entry, float] = {"wind": 1.0}
        """Of entries that were switched; the others are at 0, and only the wind is on at first."""
        self.reactions = np.zeros((len(assembly.joints), 6))
        self._springs = SpringForce(assembly.devices.springs, self._levels, self._interval)
        self._winches = WinchForce(assembly.devices.winches, self._levels, self._interval)
        self._wind = GustClock(scene, self._levels, self._interval)
        held = {i: part.mass for i, part in enumerate(assembly.parts) if scene.machine_held}
        for number, item in enumerate(scene.moving, len(assembly.parts)):
            held |= {number: item.mass} if item.held else {}
        self._held = HoldForce(held, physics["gravity"], self._levels) if held else None
        self._ledger = Ledger(self._wind)
        self._works_of_joints: list[Array] = []
        """Results of `_take_works` at earlier splits."""

    # --- what the engine does ---------------------------------------------------------------

    @abstractmethod
    def _advance(self, ahead: int, watch: Watch | None) -> None:
        """Take a step of the current length; arguments as in `engine.World.step`."""

    @abstractmethod
    def _split(self, broken: Sequence[int]) -> None:
        """As `engine.World.split`."""

    @abstractmethod
    def _weigh_objects(self) -> None:
        """Give moving objects the masses that they have in the scene now."""

    @abstractmethod
    def _inertia(self, item: SceneObject) -> Vec3:
        """Principal moments of a moving object about its centre of mass, engine frame, kg m2."""

    @abstractmethod
    def _change_interval(self) -> None:
        """Take steps of the new `_interval` from now on."""

    @abstractmethod
    def _take_works(self) -> Array:
        """(S, 2) work of suspensions and of the motors of joints in each step since the last call
        or split, J."""

    # --- what all do alike ------------------------------------------------------------------

    def switch(self, entry: Entry, level: float) -> None:
        self._ledger.interrupt(self.now.forces)
        self._levels[entry] = float(level)
        if entry in self._grips.entries:
            self._grips.switch(entry, level > 0)
        elif entry == "loads":
            self._scene = self._unloaded.loaded(level)
            self._weigh_objects()
        else:
            self.now.motors.set()

    def drive(self, levels: Mapping[Entry, float], sudden: bool) -> None:
        if sudden:
            self._ledger.interrupt(self.now.forces)
        self._levels.update(levels)
        if not self._grips.entries.isdisjoint(levels):
            for entry in self._grips.entries & levels.keys():
                self._grips.switch(entry, self._levels[entry] > 0)
        self.now.motors.set()

    @property
    def calm(self) -> int:
        return 0

    def step(self, divisions: int = 1, ahead: int = 1, watch: Watch | None = None) -> None:
        if divisions != self._divisions:
            self._divisions, self._interval = divisions, 1.0 / (self._rate * divisions)
            for timed in (self._springs, self._winches, self._wind, self.now.motors):
                timed.step = self._interval
            self._change_interval()
        self._advance(ahead, watch)
        ledger = self._ledger
        ledger.steps += 1
        ledger.time += self._interval
        if ledger.steps >= ledger.due:
            ledger.read(self.now.forces)

    def split(self, broken: Sequence[int]) -> None:
        self._ledger.interrupt(self.now.forces)
        self._works_of_joints.append(self._take_works())
        self._split(broken)

    def _plan(self, broken: Sequence[int] = ()) -> Skeleton:
        """How the parts are connected after these joints broke as well."""
        self._broken |= set(broken)
        return skeleton(len(self._assembly.parts), self._assembly.joints, self._broken)

    def _laws(self, layout: RowLayout) -> list[Law]:
        """Laws of the devices, of the wind, and of what is held."""
        assembly, drag = self._assembly, self._physics["wind_drag"]
        laws = device_laws(assembly, layout.locations, self._levels, self._springs, self._winches)
        laws += wind_laws(assembly, layout, self._scene, drag, self._wind)
        return [*laws, self._held.locate(layout.all_locations)] if self._held else laws

    # --- observation ------------------------------------------------------------------------

    def state(self) -> State:
        return self.now.readings.state(self.now.rows.table)

    def centres(self) -> Array:
        return self.now.readings.centres(self.now.rows.table)

    def snapshot(self) -> Snapshot:
        return self.now.readings, self.now.rows.table

    def states(self, snapshots: Sequence[Any]) -> State:
        return states_of(snapshots)

    def centre(self, body: Body) -> Vec3:
        if isinstance(body, int):
            now = self.now  # written out, for referees
            row, at = now.rows[now.readings.row_of[body]], now.readings.centre_at[body]
            return centre_of(row, at)
        item = self._objects[body]
        if not item.mass:
            return item.position
        px, py, pz, x, y, z, w, *_ = self.row(body)
        return swap(subtract((px, py, pz), rotate_vector((x, y, z, w), swap(item.balance))))

    def rotation(self, body: Body) -> Quat:
        if isinstance(body, int):
            return self.now.readings.rotation(self.row(body), body)
        item = self._objects[body]
        return swap_quaternion(self.row(body)[ROTATION]) if item.mass else item.rotation

    def origin(self, block: int) -> Vec3:
        return self.now.readings.origin(self.row(block), block)

    def part(self, part: int) -> Row:
        return self.now.rows[self.now.layout.locations.row.item(part)]

    def row(self, body: Body) -> Row:
        now = self.now
        if isinstance(body, int):
            return now.rows[now.readings.row_of[body]]
        return now.rows[len(now.layout.leading) + now.layout.objects.index(body)]

    def touching(self, body: Body) -> frozenset[Body]:
        return self.now.contacts.touching(body)

    def contacts(self) -> list[Touch]:
        return self.now.contacts.all()

    def works(self) -> Array:
        self._works_of_joints = [np.concatenate([*self._works_of_joints, self._take_works()])]
        steps = self._works_of_joints[0]
        works = np.zeros((len(steps) + 1, 3))
        works[1:, :2] = steps.cumsum(axis=0)
        rows = self.now.rows.all
        for column, lines in enumerate((self._springs, self._winches)):
            if lines:
                works[:, column] += lines.works(rows).sum(axis=1)
        works[:, 1:] += self._ledger.works(self.now.forces).T
        return works

    def pulls(self) -> Mapping[int, tuple[Array, Array]]:
        parts, rows = self._assembly.parts, self.now.rows.all
        found: dict[int, tuple[Array, Array]] = {}
        for lines in (self._springs, self._winches):
            both = zip(lines.pulls.T, lines.works(rows).T, strict=True) if lines else ()
            found |= {parts[a].block: pair for (a, _), pair in zip(lines.parts, both, strict=True)}
        return found

    def energies(self, snapshot: Any) -> Array:
        readings, rows = snapshot
        moving = self._scene.moving
        masses = [item.mass for item in moving]
        inertias = [self._inertia(item) for item in moving]
        found: Array = readings.energies(rows, masses, inertias, self._physics["gravity"])
        return found

    def momentum(self) -> Mapping[str, Array]:
        return self.now.readings.momentum(self.now.rows.table)


def pair_up(one: Body, other: Body) -> Pair | None:
    """Two bodies in order; None if they are the same."""
    if one == other:
        return None
    first, last = sorted((one, other), key=_order)
    return first, last


def _order(body: Body) -> tuple[bool, int, str]:
    return (False, body, "") if isinstance(body, int) else (True, 0, body)


def sum_touches(points: Iterable[tuple[Pair | None, float, Sequence[float]]]) -> list[Touch]:
    """Every pair of bodies that touch, once.

    Args:
        points: Of each point of contact, the bodies (None counts for nothing), the normal force
            (N), and the place in the engine's frame, m.
    """
    found: dict[Pair, tuple[float, float, Sequence[float]]] = {}
    for pair, force, point in points:
        if pair is None:
            continue
        total, most, place = found.get(pair, (0.0, -1.0, point))
        if force > most:
            most, place = force, point
        found[pair] = total + force, most, place
    return [Touch(a, b, (x, z, y), total) for (a, b), (total, _, (x, y, z)) in found.items()]

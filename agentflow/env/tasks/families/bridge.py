"""The bridge family: carry a cargo whose mass grows across a gap between two banks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

from agentflow.env.feedback.compose import compose
from agentflow.env.feedback.text import block_name, number, object_label, rounded, series
from agentflow.env.rollout import Broken, Feedback, Moment, Trace, Verdict
from agentflow.env.scene import Scene, SceneObject, Start, blocks_among, objects_among
from agentflow.env.tasks.base import GENERAL, ROUNDING, Descriptor, Parameters, Schedule, WorldView
from agentflow.env.tasks.family import CommonKnobs, Family, wall
from agentflow.env.tasks.features.resting import highest_point_under
from agentflow.env.tasks.knobs import knob
from agentflow.machine.blocks.library import BRACE
from agentflow.machine.brief import SIZE_LIMIT, Brief, Limits
from agentflow.machine.geometry.placement import Bank, place
from agentflow.machine.tree import Machine

BLOCKS = (0, 1, 5, 7, 15, 35, 41, 44, 49, 63)
CARGO = "cargo"
SIZE = (2.5, 1.5, 2.5)
"""Size of the cargo, m."""
EMPTY = 1.0
"""Mass of the empty cargo, kg."""
EVERY = 0.2
"""Time between additions to the load, s: steps after each are fine."""
DROP = 1.0
"""How far below the lower bank the cargo's centre may get, m."""
ASIDE = 1.0
"""How far from the middle of the gap the cargo's centre may get, m."""
HOLD = 2.0
"""How long the cargo must be carried for a success, s."""
WIDE, LONG = 60.0, 30.0
"""Extent of the banks along x and z, m."""
COLOR = (0.75, 0.35, 0.2, 1.0)
BANKS = ("near bank", "far bank")
FLOOR = "the floor of the gap"


class Gap(Parameters):
    """The gap, across z+."""

    length: float = knob(5, 3, 30, "m", "length along z from bank to bank")
    depth: float = knob(5, 2, 20, "m", "depth below the near bank")


class Banks(Parameters):
    """What the bridge rests on."""

    rise: float = knob(0, 0, 3, "m", "height of the far bank above the near bank")
    stiffness: float = knob(
        0, 0, 1000, "kN/m", "force over depth of each point that presses into a bank; 0: hard"
    )


class Room(Parameters):
    """How large the bridge may be."""

    length: float = knob(17, 5, 40, "m", "greatest length of the machine along z")
    height: float = knob(9.5, 1, 20, "m", "greatest height of the machine")


class Load(Parameters):
    """How the cargo's mass grows."""

    most: float = knob(200, 10, 10_000, "kg", "load at the end")
    until: float = knob(17, 1, 60, "s", "time at which the whole load is on")


class BridgeKnobs(CommonKnobs):
    """Knobs of a bridge level."""

    window: float = knob(19, 1, 60, "s", "length of the scored window")
    gap: Gap = Gap()
    banks: Banks = Banks()
    room: Room = Room()
    load: Load = Load()

    @property
    def control_schedule(self) -> Schedule:
        """The load grows in equal steps; there are no motors or springs."""
        steps = max(1, round(self.load.until / EVERY))
        growth = ((self.load.until * i / steps, "loads", i / steps) for i in range(1, steps + 1))
        return Schedule(more=tuple(growth))


@dataclass(frozen=True)
class Bridge(Family):
    """Score: greatest load carried, kg.

    The load is carried while the cargo's centre stays less than 1 m below the lower bank and within
    1 m of the middle of the gap, the cargo touches only the machine, and no block touches the floor
    of the gap. Blocks that hold the cargo from the side before the load begins earn nothing.
    """

    family: ClassVar[str] = "bridge"
    unit = "kg"
    knobs: ClassVar[type[CommonKnobs]] = BridgeKnobs
    descriptors: ClassVar[tuple[Descriptor, ...]] = GENERAL[:2]
    parameters: BridgeKnobs

    @property
    def limits(self) -> Limits:
        room = self.parameters.room
        return replace(super().limits, size=(SIZE_LIMIT[0], room.height, room.length))

    @property
    def brief(self) -> Brief:
        load = self.parameters.load
        brief = self.tell(
            "bridge",
            BLOCKS,
            brace=BRACE in self.allow(BLOCKS),
            size=SIZE,
            wide=WIDE,
            empty=EMPTY,
            drop=DROP,
            aside=ASIDE,
            hold=HOLD,
            enough=load.most * min(1.0, HOLD / load.until),
        )
        greatest = load.most if self.window >= load.until else None
        return replace(brief, greatest=greatest, banks=self._resting_places)

    @property
    def _resting_places(self) -> tuple[Bank, ...]:
        """The banks, for the geometry of machines."""
        knobs = self.parameters
        return tuple(_resting_place(bank) for bank in _banks(knobs.gap, knobs.banks))

    def scene(self, machine: Machine | None = None) -> Scene:
        """Both banks, the cargo on the machine if there is one, and wind."""
        knobs = self.parameters
        banks = tuple(_banks(knobs.gap, knobs.banks))
        geometry = place(machine, self._resting_places) if machine else None
        base = geometry.height if geometry else knobs.gap.depth + knobs.banks.rise
        top = highest_point_under(machine, 0.0, 0.0, SIZE[0] / 2) if machine else 0.0
        middle = (0.0, base + top + SIZE[1] / 2, 0.0)
        cargo = SceneObject(
            CARGO, "box", SIZE, middle, mass=EMPTY, load=knobs.load.most, color=COLOR
        )
        return Scene((*banks, cargo), knobs.wind.velocity, start=Start(base))

    def referee(self, machine: Machine) -> BridgeReferee:
        return BridgeReferee(machine, self.parameters)

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """How much was carried, why it ended, and the path of the cargo."""
        terms = verdict.terms
        lines = (f"Result: {terms['result']}", f"Cost: {len(machine)} blocks")
        path = series("Cargo position", trace.even.times, trace.even.object_position[:, 0])
        return compose(machine, trace, broken, verdict, self.unit, lines, {}, (path,))


class BridgeReferee:
    """Watches until the load is no longer carried."""

    def __init__(self, machine: Machine, knobs: BridgeKnobs) -> None:
        self._machine, self._knobs = machine, knobs
        self._lowest = knobs.gap.depth - DROP
        self._load = self._share = 0.0
        """Load carried so far, kg; share of the whole load that is on."""
        self._height = self._sunk = 0.0
        """Height of the cargo's centre at t = 0, and how far it sank while it was carried, m."""
        self._end: tuple[float, str] | None = None
        """When (s) and why the load was no longer carried."""

    def start(self, world: WorldView) -> None:
        """Check that the cargo rests on the machine."""
        self._height = world.centre(CARGO)[1]
        blocks = blocks_among(world.touching(CARGO))
        high = (block for block in blocks if world.centre(block)[1] > self._height)
        if (first := next(high, None)) is not None:
            held = block_name(self._machine, first)
            self._end = 0.0, f"{held} held the cargo from the side before the load began"
        else:
            self.watch(world)

    def watch(self, world: WorldView) -> bool:
        """Update the load; True once it is no longer carried.

        What falls then, thousands of kilograms on wooden blocks, could make the simulation diverge.
        """
        if self._end is None and (why := self._why_not_carried(world)):
            self._end = world.time, why
        if self._end is not None:
            return True
        self._share = world.levels.get("loads", 0.0)
        self._load = self._share * self._knobs.load.most
        self._sunk = self._height - world.centre(CARGO)[1]
        return False

    def _why_not_carried(self, world: WorldView) -> str:
        """What ended the carrying; "" if nothing has."""
        _, y, z = world.centre(CARGO)
        if y < self._lowest:
            return f"the cargo's centre sank below y = {self._lowest:g} m"
        if abs(z) > ASIDE:
            return f"the cargo moved more than {ASIDE:g} m from the middle of the gap"
        if touched := objects_among(world.touching(CARGO)):
            where = FLOOR if touched[0] == "ground" else object_label(touched[0])
            return f"the cargo touched {where}"
        if fallen := blocks_among(world.touching("ground")):
            return f"{block_name(self._machine, fallen[0])} touched {FLOOR}"
        return ""

    def verdict(self, trace: Trace) -> Verdict:  # noqa: ARG002
        """Score and terms: load (kg), when and why it was lost, sag (m), cost in blocks."""
        load, lost_at = self._load, None if self._end is None else self._end[0]
        held = self._knobs.window if lost_at is None else lost_at
        terms: dict[str, float | bool | str | None] = {
            "load": load,
            "share": self._share,
            "success": load > 0.0 and held >= HOLD - ROUNDING,
            "held": held,
            "lost_at": lost_at,
            "sunk": self._sunk,
            "blocks": float(len(self._machine)),
            "result": self._result(),
        }
        moment = None if lost_at is None else Moment(lost_at, "the load's loss")
        return Verdict(load, terms, (), moment)

    def _result(self) -> str:
        carried = f"carried {rounded(self._load)} of {self._knobs.load.most:g} kg"
        if self._end is None:
            return f"{carried} to the end; the cargo sank by {number(self._sunk)} m"
        time, why = self._end
        return f"{carried}; at {number(time)} s {why}"


def _banks(gap: Gap, banks: Banks) -> Iterator[SceneObject]:
    soft = 1000.0 * banks.stiffness or None
    middle = (gap.length + LONG) / 2
    near, far = (WIDE, gap.depth, LONG), (WIDE, gap.depth + banks.rise, LONG)
    yield replace(wall(BANKS[0], 0.0, -middle, near), stiffness=soft)
    yield replace(wall(BANKS[1], 0.0, middle, far), stiffness=soft)


def _resting_place(bank: SceneObject) -> Bank:
    (x, y, z), (wide, high, long) = bank.position, bank.size
    low, far = (x - wide / 2, z - long / 2), (x + wide / 2, z + long / 2)
    return Bank(bank.name, y + high / 2, low, far)

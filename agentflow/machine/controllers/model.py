"""Controllers as typed, bounded data: sensors, laws, and the blocks that follow the laws."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

from agentflow.machine.blocks.types import Group

MOST = 32
"""Most sensors, laws, and outputs of a machine."""
LARGEST = 1e6
"""Greatest absolute number."""
FULL = (-1.0, 1.0)
"""The limits of a law that states none: those of levels."""


class Quantity(NamedTuple):
    """What a kind of sensors reads."""

    unit: str
    axes: tuple[str, ...]
    """Axes to choose from; () if it has none."""
    text: str
    """What it is, for designers."""

    @property
    def circular(self) -> bool:
        """Whether it jumps from 180 to -180, so that differences must not."""
        return self.unit == "degrees"


QUANTITIES: Mapping[str, Quantity] = {
    kind: Quantity(unit, tuple(axes), text)
    for kind, (unit, axes, text) in json.loads(
        (files(__package__) / "quantities.json").read_text("utf-8")
    ).items()
}
"""Kind of a sensor -> what it reads."""
RANGE = 60.0
"""Greatest distance that is sensed, m; what is further away reads as this."""

if TYPE_CHECKING:
    SensorKind = str
else:  # type checkers cannot compute a Literal
    SensorKind = Literal[tuple(QUANTITIES)]
Name = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,31}$")]
Number = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Time = Annotated[float, Field(strict=True, ge=0, le=3600, allow_inf_nan=False)]
Level = Annotated[float, Field(strict=True, ge=-1, le=1, allow_inf_nan=False)]
Speed = Annotated[float, Field(strict=True, gt=0, le=LARGEST, allow_inf_nan=False)]
Block = Annotated[int, Field(strict=True, ge=0, le=9999)]


class Part(BaseModel):
    """Frozen, and without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def to_json(self) -> dict[str, Any]:
        """As JSON data; what is as by default is left out, and whole numbers are whole."""
        found: dict[str, Any] = _shortened(self.model_dump(exclude_defaults=True))
        return found


def _shortened(data: Any) -> Any:
    if isinstance(data, dict):
        order = sorted(data, key=lambda key: {"kind": 0, "limits": 2, "rate": 3}.get(key, 1))
        return {key: _shortened(data[key]) for key in order}
    if isinstance(data, list | tuple):
        return [_shortened(value) for value in data]
    return int(data) if isinstance(data, float) and data == int(data) else data


class Sensor(Part):
    """One number that is read."""

    kind: SensorKind
    block: Block = 0
    axis: str | None = Field(None, max_length=2)

    @property
    def quantity(self) -> Quantity:
        """What it reads."""
        return QUANTITIES[self.kind]

    @model_validator(mode="after")
    def _axis_fits(self) -> Sensor:
        axes = self.quantity.axes
        if self.axis is not None and not axes:
            raise ValueError(f"{self.kind} has no axis: remove it")
        if axes and self.axis not in axes:
            raise ValueError(f"{self.kind} needs an axis, one of {', '.join(axes)}")
        return self


class _Law(Part):
    """What every law has."""

    limits: tuple[Number, Number] = FULL
    """Least and greatest output."""
    rate: Speed | None = None
    """Greatest change of the output, 1/s; None: any."""

    @model_validator(mode="after")
    def _limits_are_in_order(self) -> _Law:
        if not self.limits[0] < self.limits[1]:
            raise ValueError("limits must be [least, greatest] with least below greatest")
        return self

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors that it reads."""
        return (self.sensor,) if hasattr(self, "sensor") else ()

    @property
    def laws(self) -> tuple[str, ...]:
        """Names of the laws that it uses."""
        return ()


class Constant(_Law):
    """One level."""

    kind: Literal["constant"]
    level: Number


class Schedule(_Law):
    """A level from each of some times on, and 0 before the first."""

    kind: Literal["schedule"]
    points: tuple[tuple[Time, Number], ...] = Field(min_length=1, max_length=16)
    """Seconds since t = 0, and the level from then on."""

    @model_validator(mode="after")
    def _times_rise(self) -> Schedule:
        times = [time for time, _ in self.points]
        if any(later <= time for time, later in pairwise(times)):
            raise ValueError("the times of points must rise: sort them, and use each once")
        return self


class Proportional(_Law):
    """bias + p * (target - reading) - d * (change of the reading per second)."""

    kind: Literal["pd"]
    sensor: Name
    target: Number = 0.0
    p: Number
    d: Number = 0.0
    bias: Number = 0.0


class Switch(_Law):
    """`on` from when the reading exceeds `over` until it falls below `under`; else `off`."""

    kind: Literal["switch"]
    sensor: Name
    over: Number
    under: Number
    on: Number = 1.0
    off: Number = 0.0

    @model_validator(mode="after")
    def _thresholds_are_in_order(self) -> Switch:
        if self.under > self.over:
            raise ValueError("under must be at most over: exchange on and off to switch below")
        return self


class Term(Part):
    """A part of a sum."""

    law: Name
    weight: Number = 1.0


class Sum(_Law):
    """The weighted sum of other laws."""

    kind: Literal["sum"]
    terms: tuple[Term, ...] = Field(min_length=1, max_length=4)

    @property
    def laws(self) -> tuple[str, ...]:
        """Those that it adds."""
        return tuple(term.law for term in self.terms)


class Leave(Part):
    """When a state ends: as a reading rises above a value, or falls below it."""

    sensor: Name
    above: Number | None = None
    below: Number | None = None
    to: Name

    @model_validator(mode="after")
    def _compares_once(self) -> Leave:
        if (self.above is None) == (self.below is None):
            raise ValueError('give either "above" or "below"')
        return self


class State(Part):
    """Which law holds in a state, and what ends it; the first that applies counts."""

    name: Name
    law: Name
    leave: tuple[Leave, ...] = Field((), max_length=4)


class States(_Law):
    """The law of the current state; the first state comes first."""

    kind: Literal["states"]
    states: tuple[State, ...] = Field(min_length=1, max_length=8)

    @property
    def sensors(self) -> tuple[str, ...]:
        """Those that its states compare."""
        return tuple(leave.sensor for state in self.states for leave in state.leave)

    @property
    def laws(self) -> tuple[str, ...]:
        """Those of its states."""
        return tuple(state.law for state in self.states)

    @model_validator(mode="after")
    def _every_state_is_reached(self) -> States:
        leaves = {state.name: [leave.to for leave in state.leave] for state in self.states}
        if len(leaves) < len(self.states):
            raise ValueError("two states have the same name: give each its own")
        for to in (to for each in leaves.values() for to in each if to not in leaves):
            raise ValueError(f"there is no state {to}: the states are {', '.join(leaves)}")
        first = self.states[0].name
        if len(leaves) < 2 or not leaves[first]:
            raise ValueError(
                f"there is no way out of state {first}: give it a leave that leads to another "
                "state, or use its law directly"
            )
        reached, ahead = set(), [first]
        while ahead:
            name = ahead.pop()
            if name not in reached:
                reached.add(name)
                ahead += leaves[name]
        if missed := [name for name in leaves if name not in reached]:
            raise ValueError(f"no leave leads to state {missed[0]}: add one, or remove the state")
        return self


Law = Annotated[
    Constant | Schedule | Proportional | Switch | Sum | States, Field(discriminator="kind")
]


class Output(Part):
    """Blocks that follow a law: their level is its output times `scale`."""

    blocks: tuple[Block, ...] | None = Field(None, min_length=1, max_length=64)
    group: Group | None = None
    """In place of blocks: all of the machine that belong to it."""
    law: Name
    scale: Level = 1.0

    @model_validator(mode="after")
    def _names_blocks(self) -> Output:
        if (self.blocks is None) == (self.group is None):
            raise ValueError('give either "blocks", a list of ids, or "group"')
        return self


class Controllers(Part):
    """All that a machine senses and how it acts on it."""

    sensors: dict[Name, Sensor] = Field({}, max_length=MOST)
    laws: dict[Name, Law] = Field(min_length=1, max_length=MOST)
    outputs: tuple[Output, ...] = Field(min_length=1, max_length=MOST)

    def to_json(self) -> dict[str, Any]:
        """As JSON data, which `read_controllers` reads."""
        return {
            "sensors": {name: sensor.to_json() for name, sensor in self.sensors.items()},
            "laws": {name: law.to_json() for name, law in self.laws.items()},
            "outputs": [output.to_json() for output in self.outputs],
        }

    @property
    def blocks(self) -> set[int]:
        """Ids of the blocks that it names."""
        driven = (output.blocks or () for output in self.outputs)
        return {sensor.block for sensor in self.sensors.values()}.union(*driven)

    def renamed(self, ids: Mapping[int, int]) -> Controllers | None:
        """The controllers with the new ids of blocks. A sensor of a block without one reads the
        Starting Block; an output without blocks is left out, and None is what then remains of no
        output."""
        outputs = []
        for output in self.outputs:
            blocks = output.blocks and tuple(ids[b] for b in output.blocks if b in ids)
            if blocks != ():
                outputs.append(output.model_copy(update={"blocks": blocks}))
        sensors = {
            name: sensor.model_copy(update={"block": ids.get(sensor.block, 0)})
            for name, sensor in self.sensors.items()
        }
        if not outputs:
            return None
        return self.model_copy(update={"sensors": sensors, "outputs": tuple(outputs)})

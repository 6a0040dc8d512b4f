"""Requirements: what a machine must keep besides its task, such as a greatest mass or cost."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from math import inf, isfinite
from typing import Any, Literal, NamedTuple

from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.balance import mass
from agentflow.machine.geometry.pieces import build_order
from agentflow.machine.geometry.placement import Geometry
from agentflow.machine.problems import Problem, short_repr

Mode = Literal["must", "report"]
Relation = Literal["<=", ">=", "="]
SAID: Mapping[Relation, str] = {"<=": "at most ", ">=": "at least ", "=": ""}
MOST = 1e9
"""Stands for infinity where numbers must be finite."""
EXACT = 1e-9
"""Relative error of sums that is forgiven."""


class Counted(NamedTuple):
    """What quantities that need no simulation are read from."""

    geometry: Geometry
    given: int
    """Blocks at the beginning that the task gives: they cost nothing and are not counted."""
    prices: Mapping[int, float]

    @property
    def types(self) -> list[int]:
        """The type of each block that counts."""
        return [placed.type for placed in self.geometry.blocks if placed.id >= self.given]

    @property
    def jam(self) -> str:
        """Why the machine cannot be built in any order; "" if it can."""
        found = build_order(self.geometry)
        return found.message if isinstance(found, Problem) else ""

    @property
    def cost(self) -> float:
        """The sum of the prices."""
        return sum(self.prices.get(kind, 0.0) for kind in self.types)


class Quantity(NamedTuple):
    """Something that can be required."""

    unit: str
    words: str
    read: Callable[[Counted], float] | None = None
    """None: only a simulation tells it."""


QUANTITIES: Mapping[str, Quantity] = {
    "mass": Quantity("kg", "mass", lambda of: mass(of.geometry)),
    "cost": Quantity("credits", "cost", lambda of: of.cost),
    "blocks": Quantity("", "number of blocks", lambda of: len(of.types)),
    "types": Quantity("", "number of different block types", lambda of: len({*of.types})),
    "width": Quantity("m", "extent along x", lambda of: of.geometry.size[0]),
    "height": Quantity("m", "extent along y", lambda of: of.geometry.size[1]),
    "length": Quantity("m", "extent along z", lambda of: of.geometry.size[2]),
    "buildable": Quantity(
        "", "whether its blocks can be put on in some order (1 or 0)", lambda of: float(not of.jam)
    ),
    "safety": Quantity(
        "",
        "safety factor (1 / greatest load over strength of any connection, from t = 0 to the end)",
    ),
    "power": Quantity("W", "greatest power that springs, motors and thrusters give"),
    "energy": Quantity("J", "energy that springs, motors and thrusters give"),
    "tilt": Quantity("degrees", "greatest angle of block 0's Up from the vertical"),
    "broken": Quantity("", "number of broken connections"),
    "tolerance": Quantity("%", "share of the score kept if every block is displaced"),
}
"""By name. Blocks that the task gives do not count in `cost`, `blocks` and `types`."""
_FORM = re.compile(
    r"(?P<name>[a-z]+)(?: of (?P<within>\S+) m)? *(?P<relation><=|>=|=) *(?P<value>\S+?) *"
    r"(?P<unit>%|[A-Za-z]*)"
)


@dataclass(frozen=True)
class Requirement:
    """A quantity, how it compares, with what value."""

    quantity: str
    relation: Relation
    value: float
    """In the quantity's unit."""
    within: float = 0.0
    """How far blocks are displaced, m; only of `tolerance`."""

    @classmethod
    def parse(cls, text: str) -> Requirement:
        """Read "mass <= 60 kg", "tolerance of 0.05 m >= 80 %" or "buildable".

        Raises:
            ValueError: It is not a requirement; the message names what to change.
        """
        text = "buildable = 1" if text.strip() == "buildable" else text
        found = _FORM.fullmatch(text.strip())
        if found is None or found["name"] not in QUANTITIES:
            names = ", ".join(QUANTITIES)
            raise ValueError(
                f"{short_repr(text)} is not a requirement such as 'mass <= 60 kg'; quantities: "
                f"{names}"
            )
        name, unit = found["name"], QUANTITIES[found["name"]].unit
        if found["unit"] not in ("", unit):
            raise ValueError(f"{text!r}: {name} is {f'in {unit}' if unit else 'without a unit'}")
        within = _number(text, found["within"] or "0")
        if not within if name == "tolerance" else found["within"]:
            raise ValueError(
                f"{text!r}: write how far blocks are displaced after tolerance, and only there: "
                "tolerance of 0.05 m >= 80 %"
            )
        if within > smallest_block():
            raise ValueError(
                f"{text!r}: a tolerance of {within:g} m is larger than the smallest side of a "
                f"block; use at most {smallest_block():g} m"
            )
        return cls(name, found["relation"], _number(text, found["value"]), within)  # type: ignore[arg-type]

    def __str__(self) -> str:
        return f"{self.name} {self.relation} {self.value:g} {self._unit}".rstrip()

    @property
    def sentence(self) -> str:
        """What designers read."""
        about = f" by up to {self.within:g} m" if self.within else ""
        words = QUANTITIES[self.quantity].words
        return f"{words}{about}: {SAID[self.relation]}{self.value:g} {self._unit}".rstrip()

    @property
    def _unit(self) -> str:
        return QUANTITIES[self.quantity].unit

    @property
    def name(self) -> str:
        """The quantity, with how far blocks are displaced."""
        return self.quantity + (f" of {self.within:g} m" if self.within else "")

    def margin(self, value: float) -> float:
        """By how much a value keeps it, in its unit; negative if it misses it."""
        margins = {"<=": self.value - value, ">=": value - self.value}
        found = margins.get(self.relation, -abs(value - self.value))
        return 0.0 if abs(found) <= EXACT * max(1.0, abs(self.value)) else found


def _short(value: float) -> str:
    return f"{round(value, 3):.6g}"


def _number(text: str, value: str) -> float:
    try:
        found = float(value)
    except ValueError:
        found = inf
    if not (isfinite(found) and found >= 0):
        raise ValueError(f"{text!r}: {value} must be a number of at least 0")
    return found


@cache
def smallest_block() -> float:
    """The smallest side of any block, m."""
    return min(min(block.size) for block in library().values() if block.size)


@cache
def usual_prices() -> Mapping[int, float]:
    """Block type -> price in credits: choices of ours, in prices.json."""
    text = files("agentflow.machine.blocks").joinpath("prices.json").read_text(encoding="utf-8")
    return {int(kind): float(price) for kind, price in json.loads(text).items()}


@dataclass(frozen=True)
class Judged:
    """A requirement with what a machine has."""

    requirement: Requirement
    value: float | None
    """None: unknown, which does not meet it."""
    cause: str = ""
    """What governs the value: block, partner, time."""

    @property
    def margin(self) -> float | None:
        """By how much it is kept, in its unit; negative if it is missed, None if unknown."""
        return None if self.value is None else self.requirement.margin(self.value)

    @property
    def met(self) -> bool:
        """Whether it is kept."""
        return self.margin is not None and self.margin >= 0

    @property
    def worth(self) -> float:
        """The value, or minus it where less is better; how near it is where it must be equal."""
        if self.value is None or self.margin is None:
            return -MOST
        found = {"<=": -self.value, ">=": self.value}.get(self.requirement.relation, self.margin)
        return min(found, MOST)

    @property
    def shortfall(self) -> float:
        """How much is missing, as a share of what is required: 0 if it is met, at most 1."""
        if self.met or self.margin is None:
            return float(not self.met)
        return min(1.0, -self.margin / max(self.requirement.value, -self.margin))

    def __str__(self) -> str:
        wanted = self.requirement
        name = "safety factor" if wanted.quantity == "safety" else wanted.name
        unit = QUANTITIES[wanted.quantity].unit
        of = f"of {SAID[wanted.relation]}{wanted.value:g} {unit}".rstrip()
        if self.value is None or self.margin is None:
            told = f"{name} unknown {of}"
        else:
            by = "margin " if self.met else "missed by "
            told = f"{name} {_short(self.value)} {of} ({by}{_short(abs(self.margin))})"
        return f"{told}: {self.cause}" if self.cause else told

    def to_json(self) -> dict[str, Any]:
        """`requirement`, `value`, `margin`, `met` and `cause` as JSON data."""
        finite = self.value is not None and isfinite(self.value)
        return {
            "requirement": str(self.requirement),
            "value": self.value if finite else None,
            "margin": self.margin if finite else None,
            "met": self.met,
            "cause": self.cause,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Judged:
        """Read what `to_json` wrote; a factor of a machine without loads is infinite."""
        value = inf if data["met"] and data["value"] is None else data["value"]
        return cls(Requirement.parse(data["requirement"]), value, data["cause"])


@dataclass(frozen=True)
class Requirements:
    """All requirements of a task."""

    items: tuple[Requirement, ...] = ()
    mode: Mode = "must"
    """Whether the score counts only if all are met."""
    prices: Mapping[int, float] = field(default_factory=dict, hash=False)
    """Block type -> price in credits."""

    def __bool__(self) -> bool:
        return bool(self.items)

    def judge(self, geometry: Geometry, given: int = 0) -> tuple[Judged, ...]:
        """Those that need no simulation.

        Args:
            geometry: The machine's.
            given: How many of its blocks do not count.
        """
        counted = Counted(geometry, given, self.prices)
        return tuple(
            Judged(item, float(read(counted)), counted.jam if item.quantity == "buildable" else "")
            for item in self.items
            if (read := QUANTITIES[item.quantity].read) is not None
        )

    def sentences(self, types: Iterable[int]) -> Iterator[str]:
        """What designers read; with prices of these block types if cost matters."""
        if not self.items:
            return
        strict = "The score counts only if all requirements are met; otherwise it is 0"
        lenient = "The machine should also meet these requirements, which do not change the score"
        listed = "; ".join(item.sentence for item in self.items)
        yield f"{strict if self.mode == 'must' else lenient}. Requirements: {listed}."
        if any(item.quantity == "cost" for item in self.items):
            prices = (
                f"{library()[kind].name} {self.prices.get(kind, 0):g}" for kind in sorted({*types})
            )
            yield f"Prices in credits: {', '.join(prices)}."


NONE = Requirements()


def contradiction(items: Sequence[Requirement]) -> str:
    """Two requirements that no machine meets, in a sentence; "" without any."""
    for low in items:
        for high in items:
            same = (low.quantity, low.within) == (high.quantity, high.within)
            same = same or (low.quantity, high.quantity) == ("types", "blocks")  # never more types
            if same and low.relation != "<=" and high.relation != ">=" and low.value > high.value:
                return f"{low} contradicts {high}: change or remove one of them"
    return ""


def met_of(judged: Sequence[Judged]) -> tuple[int, int] | None:
    """How many are met, and of how many; None of none."""
    return (sum(item.met for item in judged), len(judged)) if judged else None


def count_met(judged: Sequence[Judged]) -> str:
    """Such as "met 4 of 5"."""
    return "met {} of {}".format(*(met_of(judged) or (0, 0)))


def unmet(judged: Iterable[Judged]) -> Iterator[Problem]:
    """A problem (`requirement`) for each one that is missed."""
    return (Problem("requirement", (), str(item)) for item in judged if not item.met)

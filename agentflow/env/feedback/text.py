"""Words and numbers of feedback: names of bodies, positions, vectors, thinned paths."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import hypot
from typing import Any

from agentflow.env.constants import constants
from agentflow.env.measurements import Named
from agentflow.env.rollout import Array
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine

MAX_SAMPLES = 11
"""Most samples of a series; queries return more."""
AXES = ("x+", "x-", "y+", "y-", "z+", "z-")


@dataclass(frozen=True)
class Series:
    """Positions over time, thinned to at most 11 samples."""

    label: str
    times: list[float]
    values: list[list[float]]

    @property
    def text(self) -> str:
        """One line: label, interval, start and the points in brackets."""
        return f"{self._head} (x, y, z): {' '.join(map(point_text, self.values))}"

    @property
    def _head(self) -> str:
        return f"{self.label} every {spacing(self.times):.3g} s from t = {self.times[0]:.3g} s"


@dataclass(frozen=True)
class Angles(Series):
    """One angle over time, thinned alike."""

    @property
    def text(self) -> str:
        """One line with whole degrees."""
        return f"{self._head}: {' '.join(number(angle, 0) for (angle,) in self.values)}"


def spacing(times: Sequence[float] | Array) -> float:
    """Time between even samples, s; the default interval if there is only one sample."""
    return float(times[1] - times[0]) if len(times) > 1 else constants()["sample_interval"]


def number(value: float, digits: int = 2) -> str:
    """Format with fixed decimals; never "-0.00"."""
    return f"{round(float(value), digits) + 0.0:.{digits}f}"


def rounded(value: float) -> str:
    """Format with three significant digits; never "-0"."""
    return (
        f"{float(f'{value:.3g}') + 0.0:g}" if abs(value) < 1e3 else f"{float(f'{value:.3g}'):.0f}"
    )


def point_text(point: Iterable[float], digits: int = 2) -> str:
    """Format a position: "(0.00, 1.50, 3.00)"."""
    return f"({', '.join(number(value, digits) for value in point)})"


def vector_text(vector: Sequence[float]) -> str:
    """Size and main direction: "3200 y-"."""
    return f"{rounded(hypot(*vector))} {main_axis(vector)}"


def main_axis(vector: Sequence[float]) -> str:
    """The axis nearest to a vector: "y-"."""
    index = max(range(3), key=lambda i: abs(vector[i]))
    return AXES[2 * index + (vector[index] < 0)]


def landing_text(time: object) -> str:
    """When something landed after free flight, as an item of a line."""
    return "no landing after free flight" if time is None else f"landed at {number(float(time))} s"  # type: ignore[arg-type]


def object_label(name: str) -> str:
    """An object of the scene in a sentence: "the far wall", "wall 1", "ring 2"."""
    whole = name.partition(",")[0]
    return whole if whole[-1].isdigit() else f"the {whole}"


def term_number(terms: Mapping[str, Any], name: str) -> float:
    """A term of a verdict; 0 if it does not apply."""
    return float(terms.get(name) or 0.0)


def block_name(machine: Machine, block: int) -> str:
    """Id and type of a block: "block 8 (Wooden Block)"."""
    return f"block {block} ({library()[machine[block].type].name})"


def body_name(machine: Machine, body: Named) -> str:
    """A block or object in a sentence."""
    return object_label(body) if isinstance(body, str) else block_name(machine, body)


def sample_indices(count: int, most: int = MAX_SAMPLES) -> range:
    """At most `most` evenly spaced indices into `count` samples, starting at 0."""
    return range(0, count, max(1, -(-(count - 1) // (most - 1))))


def series(label: str, times: Array, values: Array) -> Series:
    """Thin out (T,) even times and (T, K) values to a series."""
    picks = sample_indices(len(times))
    return Series(label, times[picks].tolist(), values[picks].tolist())

"""Axes of an archive of different candidates: what is measured, and how it is divided into cells.

Plain data, so that whoever measures needs no archive.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Axis:
    """One property that candidates differ in, divided into cells of equal width."""

    name: str
    """As prompts say it: "a machine whose NAME is ..."."""
    unit: str
    """"" for numbers without one."""
    low: float
    """Lower bound of the first cell; what measures less counts for it."""
    high: float
    """Upper bound of the last cell; what measures more counts for it."""
    cells: int
    labels: tuple[str, ...] = ()
    """Names of the cells, if they are categories; the value is then the number of the name."""

    @classmethod
    def of_categories(cls, name: str, labels: tuple[str, ...]) -> Axis:
        """An axis with one cell per category."""
        return cls(name, "", -0.5, len(labels) - 0.5, len(labels), labels)

    def describe(self, cell: int) -> str:
        """The values of a cell: "springs", "2 to 4 m", or "3" if it holds one whole number."""
        if self.labels:
            return self.labels[cell]
        width = (self.high - self.low) / self.cells
        start = self.low + cell * width
        if width == 1.0 and start % 1.0 == 0.5:
            return f"{start + 0.5:g}"
        return f"{start:g} to {start + width:g} {self.unit}".rstrip()


@dataclass(frozen=True)
class Measurement:
    """What one candidate measures on one axis."""

    axis: Axis
    value: float | None
    """None if the evaluation does not show it, as after a failed simulation."""

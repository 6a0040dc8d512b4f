"""The one style of all figures: colours, lines and marks that also differ without colour."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import yaml

from agentflow.extras import needs_extra

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000", "#999999")
"""Colours of M. Okabe and K. Ito, "Color universal design" (2008), which people with any colour
vision tell apart; neighbours differ in lightness."""
DASHES: Sequence[Any] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)))
MARKS = ("o", "s", "^", "D", "v", "P", "X", "*")
PANEL = (3.3, 2.5)
"""Width and height of a panel, inches: one column of a paper."""
MOST_ACROSS = 3
"""Most panels beside each other."""


@dataclass(frozen=True)
class Look:
    """How a condition looks in every panel."""

    color: str
    dashes: Any
    mark: str


def looks(conditions: Sequence[str]) -> dict[str, Look]:
    """The look of each condition: another colour and mark for each of the first eight."""
    return {
        name: Look(COLORS[i % len(COLORS)], DASHES[i % len(DASHES)], MARKS[i % len(MARKS)])
        for i, name in enumerate(conditions)
    }


@contextmanager
def drawing_style() -> Iterator[None]:
    """Draw in the style of all figures.

    Raises:
        ConfigError: matplotlib is not installed.
    """
    with needs_extra("plot"):
        import matplotlib as mpl
    own = yaml.safe_load((files(__package__) / "style.yaml").read_text("utf-8"))
    style: Any = {**mpl.rcParamsDefault, "backend": mpl.rcParams["backend"], **own}
    with mpl.rc_context(style):
        yield


def new_figure(panels: int, size: tuple[float, float] = PANEL) -> tuple[Figure, list[Any]]:
    """A figure without a window, and its panels, row by row."""
    from agentflow.notebook.figures.canvas import PaperFigure

    across = min(panels, MOST_ACROSS)
    down = -(-panels // across)
    figure = PaperFigure(figsize=(size[0] * across, size[1] * down), layout="constrained")
    axes = figure.subplots(down, across, squeeze=False).ravel().tolist()
    for unused in axes[panels:]:
        unused.set_axis_off()
    return figure, axes[:panels]

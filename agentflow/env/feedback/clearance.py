"""How high blocks pass over an upright obstacle, between samples as well."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agentflow.env.rollout import Array, Trace
from agentflow.env.rotations import conjugate, rotate
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine

Indices = NDArray[np.intp]
PARTS = 16
"""Parts into which the time between two samples is divided."""


def least_height_over(machine: Machine, trace: Trace, plane: float) -> float | None:
    """Lowest height of a block's lowest point as its centre passes a plane z = `plane` forwards, m.

    Between samples, centres follow the cubic through both positions and velocities, which is exact
    in free fall; blocks keep the orientation of the sample before.

    Args:
        machine: The simulated machine.
        trace: Its trace.
        plane: World z, m.

    Returns:
        None if no block passes.
    """
    along = trace.centre[:, :, 2]
    sample, block = np.nonzero((along[:-1] < plane) & (along[1:] >= plane))
    if not len(sample):
        return None
    rows = np.arange(len(sample))
    path = _between(trace, sample, block)
    first = np.argmax(path[:, 1:, 1] >= plane, axis=1)
    before, after = path[rows, first], path[rows, first + 1]
    rise = (plane - before[:, 1]) / np.maximum(after[:, 1] - before[:, 1], 1e-9)
    height = before[:, 0] + np.clip(rise, 0.0, 1.0) * (after[:, 0] - before[:, 0])
    return float((height - _below(machine, trace, sample, block)).min())


def _between(trace: Trace, sample: Indices, block: Indices) -> Array:
    """(C, PARTS + 1, 2) y and z of centres from a sample to the next."""
    step = (trace.times[sample + 1] - trace.times[sample])[:, None, None]
    a, b = (trace.centre[sample + k, block, None, 1:] for k in (0, 1))
    u, v = (trace.velocity[sample + k, block, None, 1:] * step for k in (0, 1))
    s = np.linspace(0.0, 1.0, PARTS + 1)[None, :, None]
    cubic: Array = a + s * (u + s * (3 * (b - a) - 2 * u - v + s * (2 * (a - b) + u + v)))
    return cubic


def _below(machine: Machine, trace: Trace, sample: Indices, block: Indices) -> Array:
    """(C,) how far blocks reach below their centres, m; nothing of two-ended ones."""
    sizes = np.array([library()[step.type].size or (0.0, 0.0, 0.0) for step in machine])
    down = rotate(conjugate(trace.rotation[sample, block]), (0.0, 1.0, 0.0))
    reach: Array = (np.abs(down) * sizes[block] / 2).sum(axis=1)
    return reach

"""How high blocks are above the ground and above obstacles, between samples as well."""

import numpy as np

from agentflow.env.feedback.separation import root_states
from agentflow.env.feedback.text import find_runs
from agentflow.env.rollout import Array, Indices, Trace
from agentflow.env.rotations import conjugate, rotate
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine

PARTS = 16
"""Parts into which the time between two samples is divided."""
GAP, LEAST_FLIGHT = 0.05, 0.1
"""Least height above the ground that counts as off it, m, and least time that is a flight, s."""


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
    reach = _reach(machine, trace.rotation)[sample, block]
    return float((height - reach).min())


def _between(trace: Trace, sample: Indices, block: Indices) -> Array:
    """(C, PARTS + 1, 2) y and z of centres from a sample to the next."""
    step = (trace.times[sample + 1] - trace.times[sample])[:, None, None]
    a, b = (trace.centre[sample + k, block, None, 1:] for k in (0, 1))
    u, v = (trace.velocity[sample + k, block, None, 1:] * step for k in (0, 1))
    s = np.linspace(0.0, 1.0, PARTS + 1)[None, :, None]
    cubic: Array = a + s * (u + s * (3 * (b - a) - 2 * u - v + s * (2 * (a - b) + u + v)))
    return cubic


def flight_of_root(machine: Machine, trace: Trace, ground: float) -> tuple[float, float] | None:
    """From when to when all that hangs together with the root was off flat ground first, s.

    Args:
        machine: The simulated machine.
        trace: Its trace.
        ground: Height of the ground, m.

    Returns:
        The times of two samples; None if it was never off the ground for `LEAST_FLIGHT`.
    """
    low = trace.centre[:, :, 1] - _reach(machine, trace.rotation)
    lowest = np.empty(len(trace.times))
    for rows, blocks in root_states(machine, trace):
        lowest[rows] = low[rows][:, blocks].min(axis=1)
    for off, start, end in find_runs((lowest > ground + GAP).tolist(), trace.times):
        if off and end - start >= LEAST_FLIGHT:
            return start, end
    return None


def _reach(machine: Machine, rotation: Array) -> Array:
    """(..., N) how far blocks reach below their centres, m, by (..., N, 4) rotations; nothing of
    two-ended ones."""
    sizes = np.array([library()[step.type].size or (0.0, 0.0, 0.0) for step in machine])
    down = rotate(conjugate(rotation), (0.0, 1.0, 0.0))
    reach: Array = (np.abs(down) * sizes / 2).sum(axis=-1)
    return reach

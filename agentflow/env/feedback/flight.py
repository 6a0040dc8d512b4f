"""The flight line: climb, lift, drag and pitch at a few times."""

from __future__ import annotations

from math import asin, degrees

import numpy as np

from agentflow.env.constants import constants
from agentflow.env.feedback.text import number, rounded
from agentflow.env.rollout import Array, Trace
from agentflow.env.rotations import rotate
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine

SHARES = (0.1, 0.5, 1.0)
"""When to report forces, as shares of the recorded time."""


def flight_lines(machine: Machine, trace: Trace) -> list[str]:
    """Weight, and at three times the vertical force, drag, speed and pitch.

    The vertical force is what blades and thrusters exert, and the wind where there is any: mass
    times acceleration plus weight and drag. The trace is evenly sampled.
    """
    if len(trace.times) < 3:
        return []
    kinds = [library()[step.type] for step in machine]
    masses = np.array([kind.mass for kind in kinds])
    resistance = masses * np.array([kind.linear_drag for kind in kinds])
    weight = masses.sum() * constants()["gravity"]
    velocity = (trace.velocity * masses[:, None]).sum(axis=1) / masses.sum()
    drag = (trace.velocity * resistance[:, None]).sum(axis=1)
    force = masses.sum() * np.gradient(velocity, trace.times, axis=0) + drag
    force[:, 1] += weight
    fronts = rotate(trace.rotation[:, 0], (0.0, 0.0, 1.0))
    texts = []
    for share in SHARES:
        index = min(round(share * (len(trace.times) - 1)), len(trace.times) - 2)
        texts.append(
            f"{trace.times[index]:.1f} s lift {rounded(force[index, 1])}, "
            f"drag {rounded(_size(drag[index]))}, climb {number(velocity[index, 1], 1)} m/s, "
            f"pitch {number(degrees(asin(np.clip(fronts[index, 1], -1.0, 1.0))), 0)}"
        )
    head = f"Flight (N; pitch of block 0's Front in degrees), weight {rounded(weight)}"
    return [f"{head}: {'; '.join(texts)}"]


def _size(vector: Array) -> float:
    return float(np.linalg.norm(vector))

"""Motors that are switched on and do not turn."""

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from agentflow.env.feedback.text import block_name, find_runs
from agentflow.env.rollout import Flags, RolloutEvent, Trace
from agentflow.env.rotations import compose, conjugate
from agentflow.env.tasks.base import Switch
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine

MAX_STALLS = 3
"""Most lines about stalled motors."""
STALL_SPEED = 0.5
"""Speed relative to its parent below which a motor counts as stalled, rad/s: a twentieth of a
wheel's speed, above the jitter of a loaded joint."""
STALL_TIME = 1.0
"""Shortest stall to report, s."""
SWUNG = 0.25
"""Angle through which a motor has swung what is attached to it, rad: about 15 degrees."""
EPSILON = 1e-9
"""Tolerance when comparing sample times, s."""


def stalled_motors(
    machine: Machine, trace: Trace, switches: Sequence[Switch]
) -> tuple[RolloutEvent, ...]:
    """Find motors that stall for a second or more while they are switched on.

    A motor is stalled in a sample if its angular velocity differs from its parent's by less than
    0.5 rad/s. One that is switched off, or that stands at the stop of its joint, is not; nor is one
    that has swung what is attached to it since it was last switched, such as a boom that has
    arrived where it rests.

    Args:
        machine: The simulated machine.
        trace: Its evenly sampled trace.
        switches: What is switched when.
    """
    events = []
    for step in machine:
        kind = library()[step.type]
        joint = kind.joint
        turns = kind.non_static and (joint.kind, joint.axis) == ("revolute", "Front")
        if not turns or joint.stops_deg or step.parent < 0:
            continue
        relative = trace.angular_velocity[:, step.id] - trace.angular_velocity[:, step.parent]
        still = np.linalg.norm(relative, axis=1) < STALL_SPEED
        still &= trace.alive[:, step.id] & _powered(trace, step.id, switches)
        for stalled, begin, end in find_runs(still.tolist(), trace.times):
            if not stalled or end - begin < STALL_TIME:
                continue
            carries = any(step.id in other.parents for other in machine)
            if not (carries and _swung(trace, step.id, step.parent, switches, begin) > SWUNG):
                text = f"{block_name(machine, step.id)} from {begin:.1f} to {end:.1f} s"
                events.append(RolloutEvent(begin, "motor_stalled", (step.id,), text))
    return tuple(events)


def _powered(trace: Trace, block: int, switches: Sequence[Switch]) -> Flags:
    """(T,) whether a motor is on; not when it is switched on: then it stands still."""
    powered = np.zeros(len(trace.times), dtype=bool)
    for time, entry, level in switches:
        if entry in ("motors", block):
            powered[trace.times > time + EPSILON] = level != 0.0
    return powered


def _swung(
    trace: Trace, block: int, parent: int, switches: Sequence[Switch], begin: float
) -> float:
    """The greatest angle through which a motor turned from its last switch until a time, rad."""
    times = [time for time, entry, _ in switches if entry in ("motors", block) and time <= begin]
    since = (trace.times >= max(times) - EPSILON) & (trace.times <= begin + EPSILON)
    turned = compose(conjugate(trace.rotation[since, parent]), trace.rotation[since, block])
    cosine = np.abs((turned * turned[:1]).sum(axis=1)).min()
    return float(2.0 * np.arccos(min(cosine, 1.0)))


def stall_lines(events: Sequence[RolloutEvent]) -> list[str]:
    """The stalls, one line for all motors of a type that stall at the same time."""
    lines = []
    ordered = sorted(events, key=_name_and_time)
    for (name, when), group in groupby(ordered, key=_name_and_time):
        ids = ", ".join(str(event.blocks[0]) for event in group)
        lines.append(f"block{'s' * (',' in ids)} {ids} ({name}) {when}")
    told = [f"Motor stalled: {line}" for line in lines[:MAX_STALLS]]
    if rest := len(lines) - len(told):
        told.append(f"Motor stalled: {rest} more times")
    return told


def _name_and_time(event: RolloutEvent) -> tuple[str, str]:
    name, _, when = event.text.partition(" (")[2].partition(") ")
    return name, when

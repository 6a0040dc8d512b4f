"""Descriptors: properties along which a search keeps machines that work in different ways.

Pure functions of a machine and its rollout. A family declares the two or three that suit it; the
ranges and numbers of cells are choices of ours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from agentflow.env.feedback.release import sample_at
from agentflow.env.mechanism import DRIVES, classify, moment_of, payload_of, work_shares
from agentflow.env.rollout import Rollout
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.balance import mass
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine
from agentflow.search.elites.axes import Axis, Measurement


@dataclass(frozen=True)
class Descriptor:
    """One property and how it is measured."""

    axis: Axis
    measure: Callable[[Machine, Rollout], float | None]
    """None if the rollout does not show it."""


def measure(
    descriptors: Sequence[Descriptor], machine: Machine, rollout: Rollout
) -> tuple[Measurement, ...]:
    """What a machine measures on every axis; no values unless its simulation ended well."""
    done = rollout.status == "ok"
    return tuple(
        Measurement(item.axis, item.measure(machine, rollout) if done else None)
        for item in descriptors
    )


def count_blocks(machine: Machine, rollout: Rollout) -> float:  # noqa: ARG001
    """Number of blocks."""
    return float(len(machine))


def weigh(machine: Machine, rollout: Rollout) -> float:  # noqa: ARG001
    """Mass of all blocks, kg."""
    return mass(place(machine))


def number_drive(machine: Machine, rollout: Rollout) -> float | None:
    """Number of the drive of the mechanism class in `mechanism.DRIVES`."""
    mechanism = classify(machine, rollout)
    return None if mechanism is None else float(DRIVES.index(mechanism.drive))


def share_of(source: str) -> Callable[[Machine, Rollout], float | None]:
    """The function that measures the share of one source in the work put in; see `work_shares`.

    A rollout with less than 1 J of work has share 0 of every source.
    """

    def share(machine: Machine, rollout: Rollout) -> float | None:  # noqa: ARG001
        energy = None if rollout.trace is None else rollout.trace.measured.energy
        return None if energy is None else (work_shares(energy) or {source: 0.0})[source]

    return share


def release_height(machine: Machine, rollout: Rollout) -> float | None:
    """Height of the payload's centre at its release, m; of a payload that stays, at t = 0."""
    trace, payload = rollout.trace, payload_of(machine, rollout)
    if trace is None or not isinstance(payload, int):
        return None
    return float(trace.centre[sample_at(trace, moment_of(rollout).get("time", 0.0)), payload, 1])


def count_driven_wheels(machine: Machine, rollout: Rollout) -> float:  # noqa: ARG001
    """Number of powered wheels."""
    return float(sum(library()[step.type].powered_wheel for step in machine))


def wheelbase(machine: Machine, rollout: Rollout) -> float:  # noqa: ARG001
    """Distance along z between the centres of the foremost and the rearmost wheel as built, m.

    0 with fewer than two wheels.
    """
    wheels = [item for item in place(machine).blocks if library()[item.type].category == "Wheel"]
    along = [item.center[2] for item in wheels]
    return max(along) - min(along) if along else 0.0


ON_WHEELS = (
    Descriptor(Axis("number of powered wheels", "", -0.5, 11.5, 12), count_driven_wheels),
    Descriptor(Axis("wheelbase", "m", 0.0, 16.0, 8), wheelbase),
)
"""For families whose machines drive."""
GENERAL = (
    Descriptor(Axis("number of blocks", "", 0.0, 40.0, 8), count_blocks),
    Descriptor(Axis("mass", "kg", 0.0, 40.0, 8), weigh),
    Descriptor(Axis.of_categories("drive", DRIVES), number_drive),
)
"""For families without their own; 40 is the usual budget of blocks, most of which weigh 1 kg at
most."""

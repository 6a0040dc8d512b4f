"""How a machine works: what drives it, what holds, and how it releases.

The rules read the machine and the recorded rollout, up to the moment that decides the score
(release, take-off, ...) or, without one, the end of the window. The limits are choices of ours.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

from agentflow.env.feedback.separation import sample_at
from agentflow.env.measurements import Energy
from agentflow.env.rollout import Rollout, Trace
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine

Drive = Literal["springs", "falling weight", "wheels", "rotors", "motors", "mixed", "nothing"]
Hold = Literal[
    "container", "grabber", "open seat", "contact", "driven wheels", "wheels", "blocks", "nothing"
]
LetGo = Literal["breakage", "decoupler", "arm", "slider", "body", "nothing"]
DRIVES: tuple[Drive, ...] = get_args(Drive)

LEAST_WORK = 1.0
"""Least work that counts as a drive, J: it lifts the lightest machines by less than a block."""
MAIN_SHARE = 2 / 3
"""Share of the work from which on one source is the drive, rather than a mixture."""


@dataclass(frozen=True)
class Mechanism:
    """The class of a machine in one rollout; machines of one class work in the same way."""

    drive: Drive
    """Source of at least two thirds of the work that was put in. Motors count as `wheels` if a
    powered wheel touched ground or scene, else as `rotors` if there is a propeller or flying block,
    else as `motors`. `mixed`: no source did as much. `nothing`: less than 1 J in all."""
    hold: Hold
    """What held the payload: a container or grabber that it is attached to or that touched it, an
    `open seat` (any other block that it is attached to), `contact` (any other touch). Without a
    payload, what the machine stood on: driven wheels, other wheels, other blocks, or nothing."""
    let_go: LetGo
    """How the payload left, by the blocks from what it left to the root: after a `breakage` there;
    off an opened `decoupler`; off an `arm` that turns on a joint, or a `slider`; off the `body`,
    without a joint. Without a payload, whether any block broke or opened. Else `nothing`."""

    def __str__(self) -> str:
        return f"{self.drive} / {self.hold} / {self.let_go}"


def classify(machine: Machine, rollout: Rollout) -> Mechanism | None:
    """The class of a machine; None without a recorded rollout that ended well and measured work."""
    trace = rollout.trace
    if rollout.status != "ok" or trace is None or trace.measured.energy is None:
        return None
    payload = payload_of(machine, rollout)
    return Mechanism(
        _drive(machine, trace, trace.measured.energy),
        _stand(machine, trace) if payload is None else _grip(machine, trace, payload),
        _release(machine, rollout, trace, payload),
    )


def moment_of(rollout: Rollout) -> Mapping[str, Any]:
    """The fields of the decisive moment (`rollout.Moment`); none if there was no such moment."""
    return rollout.feedback.data.get("moment") or {}


def payload_of(machine: Machine, rollout: Rollout) -> int | str | None:
    """What is thrown, carried or pushed at the decisive moment, or else the first block that only
    rests on its parent; None if the machine itself moves."""
    loose = (step.id for step in machine if library()[step.type].joint.kind == "loose")
    body: int | str | None = moment_of(rollout).get("body")
    return next(loose, None) if body is None else body


def work_shares(energy: Energy) -> dict[str, float] | None:
    """Shares of springs, motors and falling weight in the work put in; None below 1 J.

    Only positive work counts: a source that took up work in sum, such as a weight that was lifted,
    has share 0.
    """
    work = {"springs": energy.springs, "motors": energy.motors, "falling weight": energy.gravity}
    total = sum(max(0.0, value) for value in work.values())
    if total < LEAST_WORK:
        return None
    return {name: max(0.0, value) / total for name, value in work.items()}


def _drive(machine: Machine, trace: Trace, energy: Energy) -> Drive:
    shares = work_shares(energy)
    if shares is None:
        return "nothing"
    if shares["springs"] >= MAIN_SHARE:
        return "springs"
    if shares["falling weight"] >= MAIN_SHARE:
        return "falling weight"
    if shares["motors"] < MAIN_SHARE:
        return "mixed"
    kinds = [library()[step.type] for step in machine]
    if any(kinds[block].powered_wheel for block in _touching(trace)):
        return "wheels"
    return "rotors" if any(kind.thrust or kind.blade for kind in kinds) else "motors"


def _grip(machine: Machine, trace: Trace, payload: int | str) -> Hold:
    """What holds a payload: the best of all that it is attached to or touches."""
    attached = set(machine[payload].parents) if isinstance(payload, int) else set()
    touched = _touching(trace, payload) - {payload}
    kinds = [library()[machine[block].type] for block in attached | touched]
    if any(kind.shape == "container" for kind in kinds):
        return "container"
    if any(kind.grip_direction for kind in kinds):
        return "grabber"
    if attached:
        return "open seat"
    return "contact" if touched else "nothing"


def _stand(machine: Machine, trace: Trace) -> Hold:
    """What a machine without payload stands on."""
    kinds = [library()[machine[block].type] for block in _touching(trace)]
    if any(kind.powered_wheel for kind in kinds):
        return "driven wheels"
    if any(kind.category == "Wheel" for kind in kinds):
        return "wheels"
    return "blocks" if kinds else "nothing"


def _release(machine: Machine, rollout: Rollout, trace: Trace, payload: int | str | None) -> LetGo:
    moment = moment_of(rollout)
    end, holder = moment.get("time", float(trace.times[-1])), moment.get("holder")
    if payload is None:
        chain = set(range(1, len(machine)))
    else:
        chain = set() if holder is None else set(_to_root(machine, holder))
    joints = {id_: library()[machine[id_].type].joint for id_ in chain}
    if any(item.block in chain and item.time <= end for item in rollout.broken):
        return "breakage"
    alive = trace.alive[sample_at(trace, end)]
    if any(joint.switch == "decouplers" and not alive[id_] for id_, joint in joints.items()):
        return "decoupler"
    if payload is None or holder is None:
        return "nothing"
    kinds = {joint.kind for joint in joints.values()}
    if kinds & {"revolute", "spherical"}:
        return "arm"
    return "slider" if "prismatic" in kinds else "body"


def _to_root(machine: Machine, block: int) -> Iterator[int]:
    """A block and all blocks that carry it, without the root."""
    while block > 0:
        yield block
        block = machine[block].parent


def _touching(trace: Trace, body: int | str | None = None) -> set[int]:
    """Blocks that touched a body, by default the ground or any object of the scene."""
    pairs = [(contact.a, contact.b) for contact in trace.measured.contacts]
    return {
        block
        for one, block in (*pairs, *(pair[::-1] for pair in pairs))
        if isinstance(block, int) and (isinstance(one, str) if body is None else one == body)
    }

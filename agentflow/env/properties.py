"""What can be asked about a block or an object of the scene, sample by sample; world frame."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from agentflow.env.feedback.separation import PULLING
from agentflow.env.feedback.text import body_name
from agentflow.env.rollout import Array, Trace
from agentflow.env.rotations import compose, conjugate, joint_angle, joint_speed, turns
from agentflow.env.scene import Body
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine


@dataclass(frozen=True)
class Property:
    """One property: how its column is headed and read, and which bodies lack it."""

    heading: Callable[[Machine, Trace, Body], str]
    read: Callable[[Machine, Trace, Body], Array]
    """(T, K) values at the samples of a trace."""
    lacking: Callable[[Machine, Body], str] = lambda _machine, _body: ""
    """Why a body does not have it; "" if it has."""
    peak: bool = False
    """Whether a value is the greatest since the sample before, not that at the sample."""


def _state(name: str, block_name: str = "") -> Callable[[Machine, Trace, Body], Array]:
    """Reads an array of the trace, which has one for blocks and one for objects."""

    def read(_machine: Machine, trace: Trace, body: Body) -> Array:
        if isinstance(body, str):
            return np.asarray(getattr(trace, f"object_{name}")[:, trace.objects.index(body)])
        return np.asarray(getattr(trace, block_name or name)[:, body])

    return read


def _turned(machine: Machine, trace: Trace, body: Body) -> Array:
    """(T, 3) rotation since t = 0 as a rotation vector, degrees, at most half a turn."""
    rotation = _state("rotation")(machine, trace, body)
    since = compose(rotation, conjugate(rotation[:1]))
    since = np.where(since[:, 3:] < 0.0, -since, since)
    sine = np.linalg.norm(since[:, :3], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, since[:, 3:])
    turned: Array = np.degrees(since[:, :3] * (angle / np.where(sine > 0.0, sine, 1.0)))
    return turned


def _linear(name: str) -> Callable[[Machine, Trace, Body], Array]:
    def read(_machine: Machine, trace: Trace, body: Body) -> Array:
        assert isinstance(body, int)
        return np.asarray(getattr(trace, name)[:, trace.linear.index(body)][:, None])

    return read


def _load(_machine: Machine, trace: Trace, body: Body) -> Array:
    columns = [i for i, _ in _connections(trace, body)]
    return np.asarray(trace.utilisation[:, columns])


def _connections(trace: Trace, body: Body) -> list[tuple[int, int]]:
    """Column and partner of each connection with which a block holds on to another."""
    return [(i, partner) for i, (own, partner) in enumerate(trace.connections) if own == body]


def _load_heading(_machine: Machine, trace: Trace, body: Body) -> str:
    partners = ", ".join(str(partner) for _, partner in _connections(trace, body))
    return f"load (share of strength) on {partners}"


def _angle_heading(machine: Machine, _trace: Trace, body: Body) -> str:
    assert isinstance(body, int)
    axis = library()[machine[body].type].joint.axis
    faces = f", which faces {place(machine)[body].facing} as built" if axis == "Front" else ""
    return f"angle on block {machine[body].parent} (degrees about its {axis}{faces}; 0 as built)"


def _no_object(what: str) -> Callable[[Machine, Body], str]:
    """Objects lack it."""

    def lacking(machine: Machine, body: Body) -> str:
        if isinstance(body, int):
            return ""
        return f"the {what} of {body_name(machine, body)} is not recorded, only those of blocks"

    return lacking


def _no_length(machine: Machine, body: Body) -> str:
    if isinstance(body, int) and machine[body].two_ended:
        return ""
    return f"{body_name(machine, body)} has no length; only two-ended blocks have one"


def _no_pull(machine: Machine, body: Body) -> str:
    if isinstance(body, int) and library()[machine[body].type].connector in PULLING:
        return ""
    return f"{body_name(machine, body)} does not pull; only springs and winches do"


def _no_joint(machine: Machine, body: Body) -> str:
    if isinstance(body, int) and turns(machine, body):
        return ""
    found = ", ".join(str(step.id) for step in machine if turns(machine, step.id))
    others = f"blocks that do: {found}" if found else "no block of this machine does"
    return f"{body_name(machine, body)} does not turn on a parent; {others}"


def _no_load(machine: Machine, body: Body) -> str:
    if isinstance(body, int) and machine[body].parent >= 0:
        return ""
    return f"{body_name(machine, body)} holds on to no other block; ask about those that hold on it"


def _angle(machine: Machine, trace: Trace, body: Body) -> Array:
    assert isinstance(body, int)
    return np.degrees(joint_angle(machine, trace, body))[:, None]


def _speed(machine: Machine, trace: Trace, body: Body) -> Array:
    assert isinstance(body, int)
    return joint_speed(machine, trace, body)[:, None]


def _said(heading: str) -> Callable[[Machine, Trace, Body], str]:
    return lambda _machine, _trace, _body: heading


PROPERTIES: Mapping[str, Property] = {
    "position": Property(_said("position (x, y, z) m"), _state("position", "centre")),
    "rotation": Property(_said("turned since t = 0 about x, y, z (degrees)"), _turned),
    "velocity": Property(_said("velocity (x, y, z) m/s"), _state("velocity")),
    "angular_velocity": Property(
        _said("angular velocity about x, y, z (rad/s)"),
        _state("angular_velocity"),
        _no_object("angular velocity"),
    ),
    "length": Property(_said("length m"), _linear("length"), _no_length),
    "joint_angle": Property(_angle_heading, _angle, _no_joint),
    "joint_speed": Property(_said("speed of its joint (rad/s)"), _speed, _no_joint),
    "pull": Property(_said("pull N"), _linear("pull"), _no_pull),
    "work": Property(_said("work since t = 0 J"), _linear("work"), _no_pull),
    "load": Property(_load_heading, _load, _no_load, peak=True),
}
"""By name. Position and velocity are those of the centre."""

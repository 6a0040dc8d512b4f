"""Measures in the engine the facts of physics that prompts state, and prints both numbers.

    python benchmarks/facts.py

The stated numbers are in agentflow/prompts/facts.yaml; tests/env/test_facts.py compares them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import cos, hypot, radians, sin
from typing import Any
from weakref import finalize

import numpy as np

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import EngineSpec, World
from agentflow.env.physics.engines import default_engine
from agentflow.env.physics.laws.flight import PropellerBlade
from agentflow.env.physics.loads import Loads
from agentflow.env.rollout import Array
from agentflow.env.scene import Scene, SceneObject, Start
from agentflow.machine import Machine, library, place, read_machine
from agentflow.machine.geometry.vectors import dot, length, scale, subtract
from agentflow.prompts.render import facts

RATE = 480.0
ANCHOR = 1e6
"""kg, of a root that nothing moves."""
HIGH = Scene(start=Start(height=100.0))
"""Nothing touches anything here."""
ENDS = {2: ("parent", "face_id"), 4: ("parent_a", "face_id_a", "parent_b", "face_id_b")}
FLYWHEEL = [(35, 1, 0), *((63, 2, face) for face in (1, 2, 3, 4))]
"""On the Front of block 1."""
CAR = [(15, 0, 2), (15, 0, 3), (63, 0, 0), (63, 0, 1), *((2, b, f) for b in (3, 4) for f in (3, 6))]
POST = [(63, 0, 4), (63, 1, 12), (35, 2, 0)]
"""A post with an arm, and ballast at its end."""


class Stand:
    """A machine in a world of its own, stepped at 480 Hz."""

    def __init__(
        self,
        blocks: Sequence[tuple[int, ...]],
        scene: Scene = HIGH,
        *,
        anchored: bool = True,
        gravity: bool = False,
        engine: EngineSpec | None = None,
    ) -> None:
        """Build it from the type, parents and faces of all blocks but the root, by default in the
        default engine."""
        machine = machine_of(blocks)
        self.assembly = assemble(machine, place(machine), constants())
        if anchored:
            first, *rest = self.assembly.parts
            heavy = replace(first, mass=ANCHOR, inertia=(ANCHOR, ANCHOR, ANCHOR))
            self.assembly = replace(self.assembly, parts=(heavy, *rest))
        self.g = constants()["gravity"] if gravity else 0.0
        started = (engine or default_engine()).start(constants().changed({"gravity": self.g}))
        self.world: World = started.build(self.assembly, scene, RATE)
        finalize(self, started.close)  # each takes 20 MB

    def run(self, seconds: float, **levels: float) -> Stand:
        """Switch entries of the schedule, and go on."""
        for entry, level in levels.items():
            self.world.switch(entry, level)
        for _ in range(round(seconds * RATE)):
            self.world.step()
        return self

    def mass(self, first: int = 0) -> float:
        """Of all blocks from this one on."""
        return sum(part.mass for part in self.assembly.parts if part.block >= first)

    def momentum(self, axis: int) -> float:
        """Of the machine."""
        return float(self.world.momentum()["linear"][axis])

    def reaction(self, block: int) -> Array:
        """Force and moment through the connection of a block to its parent."""
        joints = self.assembly.joints
        return np.asarray(self.world.reactions[[j.block for j in joints].index(block)])

    def moment(self, block: int) -> float:
        """Of the load through a block's connection, as a share of its strength."""
        loads = Loads(self.assembly.joints, 1e-6, 1.0)
        loads.update(self.world.reactions)
        owners = [self.assembly.joints[i].block for i in loads.connections]
        return float(loads.utilisation()[owners.index(block)])

    def turning(self, block: int) -> float:
        """Spin of a block about the axis of block 1's joint."""
        spin = self.world.state().angular_velocity[block]
        return float(np.dot(spin, self.assembly.joints[0].axis))

    @property
    def spin(self) -> float:
        """Speed with which block 1 turns."""
        return abs(self.turning(1))

    @property
    def inertia(self) -> float:
        """Of all blocks but the root about the joint of block 1."""
        joint, total = self.assembly.joints[0], 0.0
        for part in self.assembly.parts[1:]:
            arm = subtract(part.centre, joint.pivot)
            off = length(subtract(arm, scale(joint.axis, dot(arm, joint.axis))))
            own = sum(m * a * a for m, a in zip(part.inertia, joint.axis, strict=True))
            total += part.mass * off * off + own
        return total


def machine_of(blocks: Sequence[tuple[int, ...]]) -> Machine:
    steps: list[Mapping[str, int]] = [{"type": 0, "id": 0, "parent": -1, "face_id": -1}]
    for number, (kind, *ends) in enumerate(blocks, start=1):
        where = dict(zip(ENDS[len(ends)], ends, strict=True))
        steps.append({"type": kind, "id": number, **where})
    machine = read_machine(steps, library()).machine
    assert machine is not None
    return machine


def _on(level: float) -> Mapping[str, float]:
    return {"motors": level, "steering_hinges": level}


def spring_pull(a: int, b: int) -> float:
    """Between two faces of the root."""
    return float(np.linalg.norm(Stand([(9, 0, a, 0, b)]).run(0.05, springs=1).reaction(1)[:3]))


def spring_damping() -> float:
    """Of a spring that pulls up a log with ballast on a hinge."""
    stand = Stand([(63, 0, 4), (5, 0, 0), (63, 2, 0), (35, 3, 0), (9, 1, 0, 4, 0)])
    before = stand.run(0.15, springs=1).world.state().length[0]
    rate = (before - stand.run(1 / RATE).world.state().length[0]) * RATE
    return float((spring_pull(2, 3) - np.linalg.norm(stand.reaction(5)[:3])) / rate)


def motor_torque(kind: int, brake: bool = False) -> float:
    """On a flywheel at rest, or that turns faster than the motor should."""
    stand = Stand([(kind, 0, 0), *FLYWHEEL])
    before = stand.run(10.0 if brake else 0.0, **_on(1)).spin
    after = stand.run(4 / RATE, **_on(0.25 if brake else 1.0)).spin
    return abs(after - before) * stand.inertia / (4 / RATE)


def motor_speed(kind: int) -> float:
    """Without load."""
    return Stand([(kind, 0, 0)]).run(0.15, **_on(1)).spin


def wheel_thrust(speed: float, level: float = 1.0) -> float:
    """Of one of four wheels of a heavy car."""
    ballast = [(35, 1, 0), (35, 2, 0), (35, 0, 4), (35, 11, 0)]
    stand = Stand([*CAR, *ballast], Scene(), anchored=False, gravity=True).run(0.5, motors=1)
    while (now := stand.momentum(2) / stand.mass()) < speed:
        stand.run(0.02)
    gain = (stand.run(0.05, motors=level).momentum(2) / stand.mass() - now) / 0.05
    drag = sum(part.mass * part.linear_drag for part in stand.assembly.parts)
    turning = 4 * 0.5  # kg: a wheel's inertia over the square of its radius
    return ((stand.mass() + turning) * gain + drag * now) / 4


def strength(kind: int, moment: bool) -> float:
    """Load at which a connection would break, from how much a known one loads it."""
    blocks = [(63, 0, 4), (kind, 1, 12)] if moment else [(kind, 0, 4)]
    stand = Stand([*blocks, (35, len(blocks), 0)], Scene(), gravity=True).run(1.0)
    load = stand.reaction(len(blocks))[3:] if moment else stand.reaction(1)[:3]
    return float(np.linalg.norm(load)) / stand.moment(len(blocks))


def brace_share() -> float:
    """Of the moment where an arm meets its post."""
    loads = [
        Stand([*POST, *braces], Scene(), gravity=True).run(1.0).moment(2)
        for braces in ([], [(7, 0, 0, 2, 12)])
    ]
    return 1 - loads[1] / loads[0]


def container_inside(axis: int) -> float:
    """Between opposite walls."""
    walls = Stand([(30, 0, 0)]).assembly.parts[1].shapes[2:]
    return min(2 * abs(w.offset[axis]) - w.size[axis] for w in walls if w.offset[axis])


def container_depth() -> float:
    """Height of the walls above the floor."""
    return max(wall.size[2] for wall in Stand([(30, 0, 0)]).assembly.parts[1].shapes[2:])


def container_wall() -> float:
    """Thickness of the thickest wall or the floor."""
    _, *sides = Stand([(30, 0, 0)]).assembly.parts[1].shapes
    return max(min(side.size) for side in sides)


def boulder_rest(face: int, axis: int) -> float:
    """Of a boulder's centre in a container on a face of the root, from its building point."""
    feet = [(63, 0, 5), *((35, 1, side) for side in (3, 6, 9, 12))]
    stand = Stand([*feet, (30, 0, face), (36, 6, 0)], Scene(), anchored=False, gravity=True)
    state = stand.run(0.5).world.state()
    return abs(float(state.centre[7, axis] - state.position[6, axis]))


def drag(kind: int) -> float:
    """For each kg, of a fall that is slowed down."""
    stand = Stand([(kind, 0, 0)], anchored=False, gravity=True)
    before = stand.run(0.5).momentum(1)
    after = stand.run(0.05).momentum(1)
    lost = (after - before) / 0.05 + stand.g * stand.mass()
    own = -2 * lost * stand.mass() / (before + after) - 0.25 * facts()["air"]["drag"]
    return own / library()[kind].mass


def wind_push() -> float:
    """On 2 m2 at rest in a wind of 6 m/s."""
    scene = Scene(wind=(6.0, 0.0, 0.0), start=HIGH.start)
    return Stand([(15, 0, 0)], scene, anchored=False).run(1 / RATE).momentum(0) * RATE / 2 / 36


def blade_lift(arm: int, fastest: float) -> float:
    """At the end of an arm of this many logs that turns at 8 rad/s, over the cube of its speed."""
    logs = [(63, 1, 3), (63, 2, 0)][:arm]
    stand = Stand([(22, 0, 4), *logs, (26, arm + 1, 0 if arm else 3)]).run(0.5, motors=1)
    speed = hypot(*stand.world.state().velocity[arm + 2])
    return float(abs(stand.reaction(arm + 2)[1]) / speed / min(speed, fastest) ** 2)


def blade_climb() -> float:
    """Speed to its Up over speed to its Right at which a blade lifts nothing."""
    (blade,) = Stand([(26, 0, 0)]).assembly.devices.moved
    assert isinstance(blade, PropellerBlade)
    right, _, up = blade.normal
    return abs(right / up)


def friction(kind: int, degrees: float, surface: float | None = None) -> float:
    """Of four feet of this type on a slope, of wood or this friction, that they slide down."""
    tilt, start = radians(degrees), Start(height=20.0, pitch=degrees)
    middle = (0.0, 20.0 - 0.2 * cos(tilt), 0.2 * sin(tilt))
    plane = SceneObject("slope", "box", (60.0, 0.4, 60.0), middle, start.rotation, friction=surface)
    cross = [(63, 0, face) for face in range(4)]
    feet = [(kind, block, 12) for block in (1, 2, 3, 4)]
    stand = Stand([*cross, *feet], Scene((plane,), start=start), anchored=False, gravity=True)
    before = stand.run(0.1).momentum(2)
    gain = (stand.run(0.1).momentum(2) - before) / 0.1 / stand.mass() / cos(tilt)
    return (sin(tilt) + gain / stand.g) / cos(tilt)


def bounce(kind: int, drops: int = 8) -> float:
    """Of a ball that falls onto a block; the mean, because steps end at different depths. A rebound
    may take 0.1 s."""
    ratios = []
    for drop in range(drops):
        ball = SceneObject(
            "ball", "sphere", (0.5, 0.5, 0.5), (0.0, 3.0 + 0.37 * drop, 0.0), mass=1.0
        )
        stand = Stand([(kind, 0, 4)], Scene((ball,)), gravity=True)
        speeds = [
            float(stand.run(1 / RATE).world.state().object_velocity[0, 1]) for _ in range(300)
        ]
        landed = speeds.index(min(speeds))
        ratios.append(-max(speeds[landed : landed + 48]) / min(speeds))
    return float(np.mean(ratios))


def suspension_stiffness() -> float:
    """From how far ballast makes it sink."""
    stand = Stand([(16, 0, 4), (35, 1, 0)], Scene(), gravity=True)
    before = np.diff(stand.world.state().centre[:2, 1])[0]
    sunk = before - np.diff(stand.run(2.0).world.state().centre[:2, 1])[0]
    return float(stand.mass(1) * stand.g / sunk)


def winch_speed(level: float) -> float:
    """Of the rope from which a log hangs, after it was wound in for 0.5 s."""
    stand = Stand([(63, 0, 4), (5, 0, 0), (63, 2, 0), (45, 1, 0, 3, 0)], Scene(), gravity=True)
    before = stand.run(0.5, winches=1).run(0.3, winches=level).world.state().length[0]
    return abs(float(stand.run(0.2).world.state().length[0] - before)) / 0.2


def hold_ball(gap: float, engine: EngineSpec | None = None) -> Stand:
    """A ball of 1 kg, this far in front of a grabber on a log, 0.3 s later."""
    ball = SceneObject("ball", "sphere", (1.0, 1.0, 1.0), (0.0, 3.5, 1.5 + gap), mass=1.0)
    return Stand([(63, 0, 4), (27, 1, 12)], Scene((ball,)), gravity=True, engine=engine).run(0.3)


def grabber_reach() -> float:
    """Greatest gap, to 2 mm, over which a grabber grips a ball that falls past it."""
    gaps = [gap / 1000 for gap in range(0, 60, 2)]
    return max(gap for gap in gaps if hold_ball(gap).world.state().object_position[0, 1] > 3.0)


def wheel_friction(kind: int) -> float:
    """N m, with which a motor that holds the axle of an unpowered wheel drags it along."""
    stand = Stand([(22, 0, 0), (kind, 1, 0)]).run(0.05, motors=1)
    wheel, before = stand.assembly.parts[2], stand.turning(2)
    gain = (stand.run(0.05).turning(2) - before) / 0.05
    return float(abs(gain) * wheel.inertia[2])


def winch_pull() -> float:
    """On a rope between two faces of the root, which cannot yield."""
    return float(np.linalg.norm(Stand([(45, 0, 2, 0, 3)]).run(1.5, winches=1).reaction(1)[:3]))


MEASURED: Mapping[tuple[str | int, ...], Callable[[], float]] = {
    ("spring", "pull"): partial(spring_pull, 2, 3),
    ("spring", "slope"): lambda: spring_pull(4, 0) / (0.5**0.5 - facts()["spring"]["shortest"]),
    ("spring", "shortest"): lambda: 0.5**0.5 - spring_pull(4, 0) / facts()["spring"]["slope"],
    ("spring", "damping"): spring_damping,
    ("spring", "end"): lambda: Stand([(9, 0, 2, 0, 3)]).assembly.parts[1].mass,
    **{("motor", kind, "torque"): partial(motor_torque, kind) for kind in facts()["motor"]},
    **{("motor", kind, "speed"): partial(motor_speed, kind) for kind in facts()["motor"]},
    ("thrust", "slow"): partial(wheel_thrust, 1.0),
    ("thrust", "fast"): partial(wheel_thrust, 9.0),
    ("thrust", "above"): partial(wheel_thrust, 9.0, 0.5),
    ("strength", "usual", 0): partial(strength, 63, False),
    ("strength", "usual", 1): partial(strength, 63, True),
    **{("strength", kind, 0): partial(strength, kind, False) for kind in (5, 22, 35, 41)},
    **{("strength", kind, 1): partial(strength, kind, True) for kind in (22, 35, 41)},
    ("brace", "share"): brace_share,
    ("container", "wide"): partial(container_inside, 0),
    ("container", "high"): partial(container_inside, 1),
    ("container", "deep"): container_depth,
    ("container", "wall"): container_wall,
    ("container", "rest"): partial(boulder_rest, 4, 1),
    ("container", "drop"): partial(boulder_rest, 0, 1),
    ("air", "drag"): partial(drag, 63),
    ("air", "flying"): partial(drag, 14),
    ("air", "wind"): wind_push,
    ("blade", "lift"): partial(blade_lift, 0, 100.0),
    ("blade", "limit"): lambda: 30.0 * (blade_lift(1, 30.0) / blade_lift(0, 100.0)) ** 0.5,
    ("blade", "climb"): blade_climb,
    ("friction", "wood"): partial(friction, 15, 45),
    ("friction", "wheel"): partial(friction, 2, 50),
    ("friction", "pad"): partial(friction, 49, 60),
    ("bounce", "wood"): partial(bounce, 15),
    ("bounce", "pad"): partial(bounce, 87),
    ("suspension", "stiffness"): suspension_stiffness,
    ("winch", "speed"): partial(winch_speed, 1),
    ("winch", "out"): partial(winch_speed, -1),
    ("winch", "pull"): winch_pull,
    ("grabber", "reach"): grabber_reach,
    **{("wheel", "friction", kind): partial(wheel_friction, kind) for kind in (40, 60)},
}
"""Path of a number in facts.yaml -> its measurement."""


def stated(path: tuple[str | int, ...]) -> float:
    """The number in facts.yaml."""
    value: Any = facts()
    for key in path:
        value = value[key]
    return float(value)


if __name__ == "__main__":
    print("| fact | stated | measured |\n|---|--:|--:|")
    for where, measure in MEASURED.items():
        print(f"| {'.'.join(map(str, where))} | {stated(where):g} | {measure():.4g} |")

"""Actuators of an MJCF file: what the engine does besides MuJoCo's steps.

Motors are velocity servos of limited torque; springs pull along tendons; thrust and air drag act at
sites. The control of an actuator is the level of its schedule entry; drag needs none.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from agentflow.env.physics.frames import swap, swap_all
from agentflow.env.physics.laws.forces import Entry
from agentflow.env.physics.laws.tension import Spring
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.mujoco.bodies import CompiledModel
from agentflow.env.physics.structure.drives import Motor, merge_drives
from agentflow.env.physics.structure.layout import drag_locations, lay_out
from agentflow.env.physics.structure.spanning_tree import Skeleton, skeleton
from agentflow.env.rollout import Array

_AFFINE = mujoco.mjtGain.mjGAIN_AFFINE
_BIASED = mujoco.mjtBias.mjBIAS_AFFINE
SERVO = 2.0
"""Gain of a motor over that with which it would reach its speed in one step. Greater gains chatter:
a motor that passes its speed in one step at full torque must get back to it in the next."""


class Actuators:
    """Adds actuators to the specification of a built model."""

    def __init__(self, built: CompiledModel, assembly: Assembly) -> None:
        self._spec, self._model, self._built = built.spec, built.model, built
        self._assembly = assembly
        self.entries: list[Entry] = []
        """The entry whose level controls each actuator; "" for drag."""

    def add(self) -> None:
        """Add all of them, drag last."""
        assembly = self._assembly
        for link in self._built.links:
            place = self._built.joints.get(link.joint)
            drive = merge_drives(assembly.joints, link)
            if place is not None and drive.turns:
                joint = self._spec.joint(str(link.joint))
                joint.frictionloss = 0.0
                lightness = self._model.dof_invweight0[place.velocity]
                for motor in drive.motors:
                    self._motor(link.joint, motor, SERVO / (lightness * self._model.opt.timestep))
        for spring in assembly.devices.springs:
            self._spring(spring)
        for thruster in assembly.devices.thrusters:
            site = self._site(thruster.part)
            made = self._add(thruster.starts, thruster.part, mujoco.mjtTrn.mjTRN_SITE, site)
            made.gear = [*swap(thruster.force), 0.0, 0.0, 0.0]
        self._drag(skeleton(len(assembly.parts), assembly.joints))

    def _motor(self, joint: int, motor: Motor, gain: float) -> None:
        """A servo with this gain, N m s, on a joint of the assembly. It would swing in explicit
        steps, which the engine takes."""
        self._spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        part = self._assembly.joints[joint].b
        made = self._add(motor.starts, part, mujoco.mjtTrn.mjTRN_JOINT, str(joint))
        made.gainprm[0], made.biastype, made.biasprm[2] = gain * motor.speed, _BIASED, -gain
        made.forcelimited, made.forcerange = True, [-motor.torque, motor.torque]

    def _spring(self, spring: Spring) -> None:
        """A pull that grows with the length to a limit, and a damper beside it."""
        tendon = self._spec.add_tendon(name=f"spring {spring.a}")
        for part in (spring.a, spring.b):
            tendon.wrap_site(self._site(part))
        growth = spring.force / spring.ramp
        for law in ((growth * spring.natural, -growth, 0.0), (0.0, 0.0, -spring.damping)):
            made = self._add(spring.starts, spring.a, mujoco.mjtTrn.mjTRN_TENDON, tendon.name)
            made.gaintype, made.gainprm[:3], made.ctrlrange = _AFFINE, law, [0.0, 1.0]
            if law[1]:
                made.forcelimited, made.forcerange = True, [-spring.force, 0.0]

    def _drag(self, plan: Skeleton) -> None:
        """The drag of each rigid cluster about the point where it exerts no torque."""
        assembly, parts = self._assembly, self._assembly.parts
        layout = lay_out(assembly, plan, ())
        locations = drag_locations(assembly, plan, layout.locations)
        loss = np.array([part.mass * part.linear_drag for part in parts])
        spin = swap_all(np.array([part.inertia for part in parts]))
        spin = spin * np.array([[part.angular_drag] for part in parts])
        for row, lead in enumerate(layout.leading):
            own = locations.row == row
            total, arms = float(loss[own].sum()), locations.offset[own]
            centre = loss[own] @ arms / total if total else np.zeros(3)
            turning = np.diag(spin[own].sum(axis=0))
            for lost, arm in zip(loss[own], arms - centre, strict=True):
                turning += lost * (arm @ arm * np.eye(3) - np.outer(arm, arm))
            if total or turning.any():
                self._resist(lead, centre, total, turning)

    def _resist(self, part: int, centre: Array, loss: float, turning: Array) -> None:
        """Brake the motion (N s/m) and turning (N m s) of a point given from a part's centre."""
        moments, axes = np.linalg.eigh(turning)
        axes[:, 0] *= np.linalg.det(axes)  # right-handed
        turn = np.zeros(4)
        mujoco.mju_mat2Quat(turn, axes.ravel())
        body = self._body(part)
        name = f"drag {part}"
        body.add_site(name=name, pos=body.ipos + centre, quat=turn)
        for direction, brake in enumerate((loss, loss, loss, *moments)):
            made = self._add("", part, mujoco.mjtTrn.mjTRN_SITE, name)
            made.gear = np.eye(6)[direction]
            made.gainprm[0], made.biastype, made.biasprm[2] = 0.0, _BIASED, -brake
            made.ctrllimited = False

    def _add(self, entry: Entry, part: int, kind: Any, target: str) -> Any:
        block = self._assembly.parts[part].block
        what = "control" if isinstance(entry, int) else entry or "drag"
        name = f"{what} {len(self.entries)} of block {block}"
        made = self._spec.add_actuator(name=name, trntype=kind, target=target)
        made.ctrllimited, made.ctrlrange = True, [-1.0, 1.0]
        self.entries.append(entry)
        return made

    def _body(self, part: int) -> Any:
        return self._spec.body(self._model.body(self._built.parts[part]).name)

    def _site(self, part: int) -> str:
        """A site at the centre of a part, made when it is first asked for."""
        name, body = f"centre of part {part}", self._body(part)
        if all(site.name != name for site in body.sites):
            body.add_site(name=name, pos=body.ipos)
        return name

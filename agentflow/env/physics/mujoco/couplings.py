"""Constraints between bodies of a MuJoCo model besides joints: loops, meshing cogs, grips."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import mujoco

from agentflow.env.physics.model import Assembly
from agentflow.env.physics.structure.drives import meshing_cogs
from agentflow.env.physics.structure.spanning_tree import Skeleton

CORRECTED = 0.2
"""Share of an error that constraints undo in each step. A linkage that a motor of 400 N m drives
then opens by 4e-6 m."""
TIGHT = 0.9999
"""Impedance of motors, dry friction and constraints; the rest is how far they give way. A loop's
loads are exact to 1e-7; with 0.99, linkages snap through dead centres."""
FIRM = (TIGHT, TIGHT, 0.001, 0.5, 2.0)


def hard(step: float) -> tuple[float, float]:
    """Stiffness and damping of constraints that let nothing move, per unit of mass, at steps of
    this length, s."""
    return -CORRECTED / step**2, -1.0 / step


def weld(spec: Any, one: str, other: str, anchor: Sequence[float], step: float) -> None:
    """Hold two bodies together as they are at rest, at an anchor in the axes of the other one."""
    made = _couple(spec, mujoco.mjtEq.mjEQ_WELD, mujoco.mjtObj.mjOBJ_BODY, one, other, step)
    made.data[:3], made.data[10] = anchor, 1.0


def add_grip(spec: Any, body: str, step: float) -> None:
    """A weld of a body, by whose name it goes, to one that is chosen when it is switched on."""
    made = _couple(spec, mujoco.mjtEq.mjEQ_WELD, mujoco.mjtObj.mjOBJ_BODY, body, "world", step)
    made.name, made.active, made.data[6], made.data[10] = body, False, 1.0, 1.0


def mesh_cogs(
    spec: Any, assembly: Assembly, plan: Skeleton, joints: Collection[int], step: float
) -> None:
    """Couple the joints of meshing cogs that sit on one cluster.

    Args:
        spec: The model's.
        assembly: The machine.
        plan: Its spanning trees.
        joints: Those that move; each is named by its number.
        step: Length of a step, s.
    """
    links = (*plan.links, *plan.loops)
    for mesh, (one, sign_one), (other, sign_other) in meshing_cogs(assembly, plan, links):
        ends = [(one, sign_one, 1.0), (other, sign_other, mesh.ratio)]
        turning = [(str(i), sign * ratio) for i, sign, ratio in ends if i in joints]
        if turning:  # a cog whose joint is rigid locks the other one
            (first, own), (second, of_other) = (*turning, ("", 0.0))[:2]
            kind, of = mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtObj.mjOBJ_JOINT
            made = _couple(spec, kind, of, first, second, step)
            made.data[1] = -of_other / own


def align_cogs(model: Any, data: Any) -> None:
    """Let cogs mesh at the positions that their joints have now."""
    for i in range(model.neq):
        if model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT:
            one, other = model.eq_obj1id[i], model.eq_obj2id[i]
            turned = data.qpos[model.jnt_qposadr[other]] if other >= 0 else 0.0
            model.eq_data[i, 0] = data.qpos[model.jnt_qposadr[one]] - model.eq_data[i, 1] * turned


def _couple(spec: Any, kind: Any, of: Any, one: str, other: str, step: float) -> Any:
    made = spec.add_equality(type=kind, objtype=of, name1=one, name2=other)
    made.data[:] = 0.0
    made.solref, made.solimp = hard(step), FIRM
    return made

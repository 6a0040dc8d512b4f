"""The energy line: what did work until the decisive moment, and what moves then."""

from __future__ import annotations

from agentflow.env.feedback.text import body_name, number, rounded
from agentflow.env.measurements import Energy
from agentflow.env.rollout import Moment
from agentflow.machine.tree import Machine

LEAST = 50.0
"""Less work than this is not told, J."""


def energy_lines(machine: Machine, energy: Energy | None, moment: Moment | None) -> list[str]:
    """One line, or [] if nothing moved."""
    if energy is None or max(map(abs, _works(energy).values())) < LEAST:
        return []
    works = ", ".join(
        f"{name} {rounded(work)}" for name, work in _works(energy).items() if abs(work) >= LEAST
    )
    when = f"{moment.name} at {number(energy.time)} s" if moment else f"{number(energy.time)} s"
    moving = f"machine {rounded(energy.machine)}"
    if moment is not None and moment.body is not None:
        moving = f"{body_name(machine, moment.body)} {rounded(energy.thrown)}, rest of the {moving}"
    gone = (
        f"lost {rounded(energy.lost)}" if energy.lost > 0 else f"air gave {rounded(-energy.lost)}"
    )
    return [f"Energy until {when} (J): work of {works}; kinetic energy of {moving}; {gone}"]


def _works(energy: Energy) -> dict[str, float]:
    return {"springs": energy.springs, "motors": energy.motors, "gravity": energy.gravity}

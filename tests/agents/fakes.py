"""A brief, a blueprint and machines for the tests of roles."""

from __future__ import annotations

from agentflow.agents.meta_designer import Blueprint, Structure
from agentflow.machine.brief import Brief
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.tree import Machine

THROWING = Brief(
    name="throwing",
    objective="Build a machine that throws its boulder as far as possible along z+.",
    scene=("The ground is flat, at y = 0; z+ is the target direction.",),
    schedule=("At t = 0 s wheels and rotating blocks start to turn.",),
    score=("Score: metres along z+; at least 0.",),
    blocks=(0, 1, 2, 5, 7, 9, 15, 16, 22, 30, 35, 36, 41, 63),
    required={36: 1},
)
MOVEMENT = Brief(
    name="movement",
    objective="Build a machine that drives as far as possible along z+.",
    scene=("The ground is flat.",),
    schedule=("At t = 0 s wheels start to turn.",),
    score=("Score: metres along z+.",),
    blocks=(0, 1, 2, 9, 15, 16, 22, 35, 41, 63),
)
PLAN = Blueprint(
    definition="A tower with a motor arm that hurls the boulder forward.",
    function_points=("stand", "hurl"),
    structures=(
        Structure("Base", "carries all", ("stand",), (1, 15), "Flat and wide."),
        Structure(
            "Arm", "hurls", ("hurl",), (22, 30, 36), "Arm to the back.\n## Task\n{{ 7919*7 }}"
        ),
    ),
)


def machine(*steps: tuple[int, int, int]) -> Machine:
    """The root and then blocks of (type, parent, face)."""
    data = [{"type": 0, "id": 0, "parent": -1, "face_id": -1}]
    data += [
        {"type": kind, "id": i, "parent": parent, "face_id": face}
        for i, (kind, parent, face) in enumerate(steps, 1)
    ]
    read = read_machine(data, range(100)).machine
    assert read is not None
    return read


FRAME = machine((1, 0, 0), (1, 0, 1))
"""Root with a wooden block on its front and its back: z from -2.5 to 2.5."""
THROWER = machine((1, 0, 0), (1, 0, 1), (63, 0, 4), (22, 3, 5), (30, 3, 0), (36, 5, 0))
"""FRAME, a log upright on the root, a rotating block on its side, a container with a boulder."""


def fenced(*machines: Machine) -> str:
    """A reply with machines in fences."""
    return "".join(f"Because.\n```json\n{item.to_text()}\n```\n" for item in machines)

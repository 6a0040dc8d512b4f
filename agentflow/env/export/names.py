"""Names of links and joints in files of other simulators: the same in each format."""

from __future__ import annotations

from agentflow.env.physics.model import Assembly
from agentflow.env.physics.structure.spanning_tree import Skeleton
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine


def link_names(machine: Machine, assembly: Assembly) -> list[str]:
    """The name of each part: id and type of its block, such as block_3_powered_wheel.

    The further parts of a block end with a number: block_5_spring_1.
    """
    names: dict[int, str] = {}
    for step, parts in zip(machine, assembly.blocks, strict=True):
        name = f"block {step.id} {library()[step.type].name}".lower().replace(" ", "_")
        names |= {part: f"{name}_{n}" if n else name for n, part in enumerate(parts)}
    return [names[part] for part in range(len(assembly.parts))]


def joint_names(links: list[str], plan: Skeleton) -> dict[int, str]:
    """The name of each joint, after the link that it carries; those that close loops come last."""
    names = {link.joint: joint_name(links[link.part]) for link in plan.links}
    return names | {loop.joint: f"{links[loop.part]}_loop_{loop.joint}" for loop in plan.loops}


def joint_name(link: str) -> str:
    """The name of the joint that carries a link."""
    return f"{link}_joint"

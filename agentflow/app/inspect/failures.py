"""Counts the failures in a run or in all runs of a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agentflow.agents.registry import replies_of
from agentflow.app.inspect.rationales import unfollowed_rationales
from agentflow.env.tasks.family import Family
from agentflow.env.tasks.registry import FAMILIES
from agentflow.errors import RunError
from agentflow.machine import Machine, library, place
from agentflow.metrics.failure_kinds import KINDS
from agentflow.metrics.failures import Failures, failures
from agentflow.metrics.machines import recorded_machine
from agentflow.runs import find_runs, read_document
from agentflow.runs.events import read_typed_events


def count_failures(path: Path) -> dict[str, Any]:
    """Count what went wrong in a run, or in all runs below a folder.

    Returns:
        `runs`, `replies`, `refused`, `machines`; `kinds`, each with name, level, unit, rule and
        count; `codes` of the refused replies and their counts.
    """
    runs = list(find_runs(path))
    if not runs:
        raise RunError(f"{path} contains no run")
    total = sum(map(_failures_of, runs), Failures())
    return {
        "runs": len(runs),
        "replies": total.replies,
        "refused": total.refused,
        "machines": total.machines,
        "kinds": [
            {key: getattr(kind, key) for key in ("name", "level", "unit", "rule")}
            | {"count": total.kinds[kind.name]}
            for kind in KINDS
        ],
        "codes": dict(total.codes.most_common()),
    }


def _failures_of(run: Path) -> Failures:
    name = str(read_document(run).get("config", {}).get("task", "")).partition("/")[0]
    # Runs can be of a family that is not installed here, or of a level from a file.
    known = name in FAMILIES
    family = FAMILIES[name] if known else Family
    return failures(
        read_typed_events(run),
        lambda digest: faces_wrong_way(recorded_machine(run, digest), family),
        replies_of,
        unfollowed_rationales(run),
        in_place=family.stays,
    )


def faces_wrong_way(machine: Machine, family: type[Family]) -> bool:
    """Whether a block faces the wrong way, by the rule of `failure_kinds.FACING`."""
    geometry = place(machine)
    for block in geometry.blocks:
        kind = library()[block.type]
        loaded = kind.shape == "container" and geometry.children(block.id)
        if loaded and block.facing != "y+":
            return True
        if kind.powered_wheel and family.drives and block.facing[0] != "x":
            return True
    return False

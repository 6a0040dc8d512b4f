"""Counts of what went wrong in a run or in all runs of a folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from agentflow.app.inspect.rationales import unfollowed_rationales
from agentflow.app.inspect.reading import recorded_machine
from agentflow.errors import RunError
from agentflow.machine import Machine, library, place
from agentflow.metrics.failures import KINDS, Failures, failures
from agentflow.runs import find_runs, read_document
from agentflow.runs.events import read_typed_events

DRIVING = frozenset({"movement", "delivery"})
"""Families whose machines drive along z, so that powered wheels must turn about x."""
STAYING = frozenset({"gearing"})
"""Families whose machines turn in place."""


def count_failures(path: Path) -> dict[str, Any]:
    """Count what went wrong in a run, or in all runs below a folder.

    Returns:
        `runs`, `replies`, `refused`, `machines`; `kinds`, each with name, level, unit, rule and
        count; `codes` of the refused replies and their counts.

    Raises:
        RunError: There is no run, or one is damaged.
    """
    runs = list(find_runs(path))
    if not runs:
        raise RunError(f"{path} holds no run")
    total = Failures()
    for run in runs:
        family = str(read_document(run).get("config", {}).get("task", "")).partition("/")[0]
        total += failures(
            read_typed_events(run),
            _misfaced_in(run, family),
            unfollowed_rationales(run),
            in_place=family in STAYING,
        )
    return {
        "runs": len(runs),
        "replies": total.replies,
        "refused": total.refused,
        "machines": total.machines,
        "kinds": [
            {
                "name": kind.name,
                "level": kind.level,
                "unit": kind.unit,
                "rule": kind.rule,
                "count": total.kinds[kind.name],
            }
            for kind in KINDS
        ],
        "codes": dict(total.codes.most_common()),
    }


def misfaced(machine: Machine, family: str) -> bool:
    """Whether a block faces the wrong way, by the rule of `metrics.failures.FACING`."""
    geometry = place(machine)
    for block in geometry.blocks:
        kind = library()[block.type]
        holds = kind.shape == "container" and geometry.children(block.id)
        if holds and block.facing != "y+":
            return True
        wheel = kind.powered_wheel
        if wheel and family in DRIVING and block.facing[0] != "x":
            return True
    return False


def _misfaced_in(run: Path, family: str) -> Callable[[str], bool]:
    def judge(digest: str) -> bool:
        return misfaced(recorded_machine(run, digest), family)

    return judge

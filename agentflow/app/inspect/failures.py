"""Owns the count of what went wrong in a run or in all runs of a folder (spec 6.3)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from agentflow.app.inspect.rationales import unkept
from agentflow.app.inspect.reading import recorded_machine, sound
from agentflow.errors import RunError
from agentflow.machine import Machine, library, place
from agentflow.metrics.failures import KINDS, Failures, failures
from agentflow.runs import find_runs, read_document, read_events

DRIVING = frozenset({"movement", "delivery"})
"""Families whose machines are to drive along z, so that powered wheels turn about x."""
STAYING = frozenset({"gearing"})
"""Families whose machines turn in place."""


def count_failures(path: Path) -> dict[str, Any]:
    """What went wrong in a run, or in all runs below a folder.

    Returns:
        `runs`, `replies`, `refused`, `machines`; `kinds`, each with name, level, unit, rule and
        count; `codes` of the refused replies.

    Raises:
        RunError: There is no run, or one is damaged.
    """
    runs = list(find_runs(path))
    if not runs:
        raise RunError(f"{path} holds no run")
    total = Failures()
    for run in runs:
        with sound(run):
            family = _family_of(run)
            judge = _misfaced_in(run, family)
            total += failures(read_events(run), judge, unkept(run), in_place=family in STAYING)
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
    """Whether a block of a machine faces the wrong way; the rule is `metrics.failures.FACING`."""
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


def _family_of(run: Path) -> str:
    return str(read_document(run).get("config", {}).get("task", "")).partition("/")[0]


def _misfaced_in(run: Path, family: str) -> Callable[[str], bool]:
    def judge(digest: str) -> bool:
        return misfaced(recorded_machine(run, digest), family)

    return judge

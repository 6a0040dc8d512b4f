"""Owns the placer: blocks added to what a task gives, in one call.

What makes a machine valid is agentflow.machine's; how often it is asked is the workflow's.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agentflow.agents.base import Parsed, Role
from agentflow.agents.context import block_rows, task_context
from agentflow.agents.designer import Design, rationale_of
from agentflow.agents.replies import machine_text, read_reply
from agentflow.agents.verdicts import shortcoming, told
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief


@dataclass(frozen=True)
class PlacerInput:
    """The task, whose brief holds what is given."""

    brief: Brief


class Placer(Role[PlacerInput, Design]):
    """Places blocks on a given structure."""

    name: ClassVar[str] = "placer"

    def variables(self, given: PlacerInput) -> Mapping[str, object]:
        """Task, blocks (those that are given too, but for the root), the given steps."""
        brief, start = given.brief, given.brief.given
        kinds = {*brief.blocks, *(step.type for step in start.steps[1:])}
        return {
            **task_context(brief),
            "blocks": block_rows([library()[kind] for kind in sorted(kinds)]),
            "machine": machine_text(start, "tree"),
            "first_id": len(start),
            "first_step": json.dumps(start[0].to_json()),
        }

    def parse(self, text: str, given: PlacerInput) -> Parsed[Design]:
        """Read the last machine of the reply."""
        report = read_reply(text, given.brief, "tree")
        machine, repaired = report.machine, report.repaired
        if machine is None:
            code = report.problems[0].code if report.problems else "unparsable"
            problem = "The reply holds no valid machine:\n" + told(report.problems)
            return Parsed(None, problem, code, repaired, parsed=report.file_valid)
        refused = shortcoming(machine, report, given.brief, complete=True)
        if refused:
            code, problem = refused
            return Parsed(None, problem, code, repaired, spatial=report.spatial_valid)
        design = Design(machine, rationale_of(text))
        return Parsed(design, repaired=repaired, spatial=report.spatial_valid)

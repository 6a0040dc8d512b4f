"""The querier: asks for recorded states of single blocks before a refinement."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agentflow.agents.base import Parsed, Role
from agentflow.agents.context import SAMPLE_REPORT, RoleInput, report_context
from agentflow.agents.replies import find_sections
from agentflow.llm.procedural.reading import Script
from agentflow.llm.procedural.refining import query
from agentflow.machine.brief import Brief
from agentflow.machine.formats.json_text import extract_json
from agentflow.machine.tree import Machine

THOUGHT = "Thought Process"
QUERIES = "Required Feedback"
_NOTHING = frozenset({"", "none", "no feedback required", "no queries"})


@dataclass(frozen=True)
class QuerierInput(RoleInput):
    """A simulated machine."""

    machine: Machine
    score: float | None = None
    """None if the simulation crashed or timed out."""
    feedback: str = ""


class Querier(Role[QuerierInput, tuple[object, ...]]):
    """Asks for recorded states of single blocks.

    Queries stay raw JSON items: they are checked when they are answered.
    """

    name: ClassVar[str] = "querier"
    stage: ClassVar[str] = "env_feedback"
    tokens: ClassVar[tuple[int, int]] = (2720, 60)
    labels: ClassVar[tuple[str, ...]] = ("Query",)
    script: ClassVar[Script] = Script(query, f"<{QUERIES}>")

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> QuerierInput:
        return QuerierInput(brief, machine, 0.0, SAMPLE_REPORT)

    def variables(self, given: QuerierInput) -> Mapping[str, object]:
        return {
            **given.context(given.machine),
            **report_context(given.score, given.feedback),
            "queries": True,
        }

    def parse(self, text: str, given: QuerierInput) -> Parsed[tuple[object, ...]]:  # noqa: ARG002
        """Read the list of queries, which may be empty."""
        found = find_sections(text, (THOUGHT, QUERIES))
        if QUERIES not in found:
            problem = f"The reply has no section <{QUERIES}>."
            return Parsed(None, problem, "missing_section", parsed=False)
        wanted = found[QUERIES]
        if wanted.strip(" .`\n").casefold() in _NOTHING:
            return Parsed(())
        many, repaired = extract_json(wanted, list)
        if many is None:
            one, repaired = extract_json(wanted, dict)
            many = None if one is None else [one]
        if many is not None:
            return Parsed(tuple(many), repaired=repaired)
        problem = (
            f"<{QUERIES}> contains no JSON list. Example: "
            '[{"id": 3, "duration": [0.0, 1.0], "properties": ["position"]}]'
        )
        return Parsed(None, problem, "unparsable", parsed=False)

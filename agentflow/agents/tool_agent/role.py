"""The agent: designs machines by calling tools, in a conversation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from agentflow.agents.base import Parsed, Role
from agentflow.agents.context import RoleInput
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

NO_CALL = "The reply calls no tool."


class AgentInput(RoleInput):
    """A task."""


class Agent(Role[AgentInput, str]):
    """Designs machines with tools."""

    name: ClassVar[str] = "agent"
    stage: ClassVar[str] = "env_feedback"
    tokens: ClassVar[tuple[int, int]] = (9000, 150)
    """A brief of 4,600 tokens and the schemas of tools, and ten earlier turns on average."""

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> AgentInput:  # noqa: ARG003
        return AgentInput(brief)

    @classmethod
    def stage_for(cls, purpose: str) -> str:
        """The purpose of a call is its stage."""
        return purpose or cls.stage

    def variables(self, given: AgentInput) -> Mapping[str, object]:
        start = given.brief.given
        return given.context(start if len(start) > 1 else None)

    def parse(self, text: str, given: AgentInput) -> Parsed[str]:  # noqa: ARG002
        """A reply without tool calls; it ends nothing by itself."""
        return Parsed(None, NO_CALL, "no_tool_call", parsed=False)

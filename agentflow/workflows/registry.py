"""Owns the names of the workflows."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from agentflow.errors import UnknownNameError
from agentflow.workflows.base import Workflow
from agentflow.workflows.hierarchical import hierarchical
from agentflow.workflows.iterative import iterative
from agentflow.workflows.random_dsl import random_dsl
from agentflow.workflows.single import single

WORKFLOWS: Mapping[str, Workflow] = MappingProxyType(
    {
        "single": single,
        "iterative": iterative,
        "hierarchical": hierarchical,
        "random-dsl": random_dsl,
    }
)
WITHOUT_MODEL = frozenset({"random-dsl"})
"""Workflows that ask no model."""


def workflow(name: str) -> Workflow:
    """The workflow of that name.

    Raises:
        UnknownNameError: There is none.
    """
    if name not in WORKFLOWS:
        raise UnknownNameError("workflow", name, WORKFLOWS)
    return WORKFLOWS[name]

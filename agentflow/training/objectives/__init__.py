"""Design objectives for training data, and the function tests that see whether machines work."""

from agentflow.training.objectives.functions import FUNCTIONS
from agentflow.training.objectives.measuring import Finding
from agentflow.training.objectives.objective import (
    OBJECTIVES,
    Objective,
    ObjectiveTask,
    ObjectiveVerdict,
    read_objectives,
    works,
)

__all__ = [
    "FUNCTIONS",
    "OBJECTIVES",
    "Finding",
    "Objective",
    "ObjectiveTask",
    "ObjectiveVerdict",
    "read_objectives",
    "works",
]

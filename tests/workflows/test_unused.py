"""Settings of searches that a workflow does not use are named, and only those."""

from __future__ import annotations

from typing import Any

import pytest

from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.settings import WorkflowSettings

TRIALS: dict[str, Any] = {"local_trials": 4, "lessons": True, "inspirations": 1}
POOLED: dict[str, Any] = {"search": {"strategy": "ab-mcts"}}


@pytest.mark.parametrize(
    ("name", "settings", "unused"),
    [
        ("hierarchical", TRIALS, []),
        ("iterative", POOLED | TRIALS, []),
        ("iterative", POOLED | {"another_mechanism": True}, []),
        (
            "iterative",
            {"another_mechanism": True, "search": {"strategy": "mcts"}},
            ["another_mechanism"],
        ),
        ("single", {"search": {"strategy": "best_of_n"}}, ["search.strategy"]),
        ("single", POOLED, ["search.strategy"]),
        ("random-dsl", POOLED | {"local_trials": 1}, ["local_trials", "search.strategy"]),
        ("tools", TRIALS, ["local_trials", "inspirations", "lessons"]),
        ("explore", POOLED, ["search.strategy"]),
        ("explore", {"search": {"strategy": "map-elites"}}, []),
        ("placement", {}, []),
        ("iterative", {"models": ["a", "b"]}, []),
        ("iterative", {"models": ["a"], "search": {"strategy": "mcts"}}, ["models"]),
        ("single", {"emitters": ["edit"], "models": ["a"]}, ["models", "emitters"]),
        ("iterative", {"emitters": ["edit"], "search": {"strategy": "mcts"}}, ["emitters"]),
        ("iterative", {"emitters": ["edit"], "search": {"strategy": "independent"}}, ["emitters"]),
        ("iterative", {"emitters": ["edit"], "novelty": False}, []),
        ("explore", {"emitters": ["edit"], "novelty": False}, []),
        ("tools", {"novelty": False}, ["novelty"]),
        ("hierarchical", {"analyst": True, "lessons": True}, []),
        ("hierarchical", {"analyst": True}, ["analyst"]),
        ("tools", {"analyst": True}, ["analyst"]),
        ("iterative", {"inspector": False, "meta_designer": "off"}, ["inspector", "meta_designer"]),
        ("iterative", {"inspector": False, "search": {"strategy": "mcts"}}, []),
        ("hierarchical", {"meta_designer": "detailed", "querier": False, "drafts": True}, []),
    ],
)
def test_what_changes_nothing_is_named(
    name: str, settings: dict[str, Any], unused: list[str]
) -> None:
    given = WorkflowSettings.model_validate(settings)
    assert WORKFLOWS[name].unused(given) == unused


def test_nothing_is_unused_by_default() -> None:
    for name, workflow in WORKFLOWS.items():
        assert workflow.unused(WorkflowSettings()) == [], name

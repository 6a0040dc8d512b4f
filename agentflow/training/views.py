"""The registry of views for `agentflow table` of evaluations and training. It loads no view."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from agentflow.registry import Registry, is_callable

if TYPE_CHECKING:
    from agentflow.metrics.tables import Table

CURVES = "curves"

VIEWS: Registry[Callable[..., Table]] = Registry(
    "view of evaluations and training runs",
    None,
    {
        "published": "agentflow.training.evaluation.tables:general_table",
        "scores": "agentflow.training.evaluation.tables:uncertainty_table",
        "transfer": "agentflow.training.evaluation.tables:transfer_table",
        "best": "agentflow.training.evaluation.tables:best_table",
        CURVES: "agentflow.training.evaluation.tables:curves_table",
    },
    is_callable,
)
"""Name of a view -> function that makes its table."""
COMPARED = ("published", "scores", "transfer")
"""Views with published rows, which their functions add if `with_published`."""

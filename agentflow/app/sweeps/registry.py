"""The registry of views for `agentflow table` of a sweep. Importing it loads no view."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from agentflow.registry import Registry, is_callable

if TYPE_CHECKING:
    from agentflow.app.sweeps.tables import SweepResult
    from agentflow.metrics.tables import Table

LAYOUT = "published"
HUMAN = "human"
VERIFIED = "verified"
MECHANISMS = "mechanisms"

VIEWS: Registry[Callable[[SweepResult], Table]] = Registry(
    "view",
    None,
    {
        LAYOUT: "agentflow.app.sweeps.tables:layout_table",
        "scores": "agentflow.app.sweeps.views:scores_table",
        "usage": "agentflow.app.sweeps.views:usage_table",
        HUMAN: "agentflow.app.sweeps.views:players_table",
        "expansions": "agentflow.app.sweeps.views:expansions_table",
        VERIFIED: "agentflow.app.sweeps.views:verified_table",
        MECHANISMS: "agentflow.app.sweeps.views:mechanisms_table",
    },
    is_callable,
)

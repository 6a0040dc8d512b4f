"""A page with the film of one rollout, for tests and measurements in a browser."""

from __future__ import annotations

from agentflow.app.pages.films import Shapes, machine_data
from agentflow.env.rollout import Rollout
from agentflow.env.tasks.base import Task
from agentflow.machine import Machine
from agentflow.report.page import page


def one_film(machine: Machine, task: Task, rollout: Rollout) -> str:
    """The text of a gallery with this machine only."""
    shapes = Shapes()
    shown = machine_data(machine, rollout, shapes)
    asked = {"title": task.name, "objective": task.brief.objective, "score": [], "scene": []}
    card = {"machine": "0", "task": task.name, "asked": asked, "about": "", "run": "", "why": ""}
    card |= {"score": rollout.score, "verified": None, "picture": None, "share": ""}
    data = {"kind": "gallery", "title": task.name, "machines": {"0": shown}, "cards": [card]}
    return page(task.name, {**data, **shapes.data})

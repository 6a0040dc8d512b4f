"""The figure of how robust a machine is, from the result of `agentflow robustness`."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from agentflow.app.subjects.robustness import KEPT
from agentflow.env.drawing.stills import png_url
from agentflow.env.simulation.variations import DEFAULT
from agentflow.env.tasks.registry import known_unit
from agentflow.errors import RunError
from agentflow.machine import Machine, library, read_machine
from agentflow.machine.tree import MachineJson
from agentflow.metrics.cells import mean_known
from agentflow.report.page import require_writable, write_page

PICTURE = (640, 480)
"""Width and height of the picture of the most sensitive block, in pixels."""
SHOWN = 5
"""Most blocks and faces listed, the most sensitive first."""


class _Simulated(BaseModel):
    variation: str = ""
    engine: str = ""
    status: str
    score: float | None


class _Sensitive(BaseModel):
    block: int
    name: str
    face: int | None = None
    mean: float


class _Edits(BaseModel):
    scores: list[float]
    kept: float | None
    missing: int


class _Found(BaseModel):
    """What the figure shows of the result of `measure_robustness`."""

    machine: MachineJson
    score: float | None
    robust: float | None
    conditions: list[_Simulated]
    others: list[_Simulated]
    edits: _Edits
    blocks: list[_Sensitive]
    faces: list[_Sensitive]


def page_writer(out: Path) -> Callable[[Mapping[str, Any]], None]:
    """Check that a page can be written; returns a function that writes a result to it."""
    require_writable(out)
    return partial(_write_page, out)


def kept_figure(path: Path, machine: Machine | None) -> dict[str, Any] | None:
    """The figure of the result that `agentflow robustness` has kept in a run; None without one.

    Raises:
        RunError: The file is damaged, or about another machine.
    """
    file = path / KEPT
    if machine is None or not file.is_file():
        return None
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
        if _machine_of(_Found.model_validate(found)) != machine:
            raise ValueError("another machine")
        return robustness_figure(found)
    except ValueError:
        raise RunError(
            f"{file} is damaged, or about another machine; make it again with: "
            f"agentflow robustness {path}"
        ) from None


def robustness_figure(given: Mapping[str, Any]) -> dict[str, Any]:
    """The data of the figure.

    Raises:
        ValueError: The data are not those of `measure_robustness` for a valid machine.
    """
    found = _Found.model_validate(given)
    machine, worst = _machine_of(found), next(iter(found.blocks), None)
    if worst is not None and not 0 <= worst.block < len(machine):
        raise ValueError(f"the machine has no block {worst.block}")
    return {
        "score": found.score,
        "robust": found.robust,
        "kept": found.edits.kept,
        "neighbours": len(found.edits.scores),
        "rows": [_row(name, scores) for name, scores in _scores_by_quantity(found).items()],
        "conditions": [item.model_dump() for item in found.conditions],
        "others": [{**item.model_dump(), "variation": item.engine} for item in found.others],
        "blocks": [item.model_dump() for item in found.blocks[:SHOWN]],
        "faces": [item.model_dump() for item in found.faces[:SHOWN]],
        "picture": worst
        and png_url(machine, view="three-quarter", size=PICTURE, red=(worst.block,)),
    }


def _write_page(out: Path, found: Mapping[str, Any]) -> None:
    about = f"{found['engine']}, seed {found['seed']}"
    figure = robustness_figure(found)
    task = found["task"]
    data = {"kind": "robustness", "task": task, "unit": known_unit(task), "about": about}
    write_page(out, f"Robustness · {task} · agentflow", {**data, "robustness": figure})


def _machine_of(found: _Found) -> Machine:
    machine = read_machine(found.machine, tuple(library())).machine
    if machine is None:
        raise ValueError("the machine cannot be read")
    return machine


def _scores_by_quantity(found: _Found) -> dict[str, list[float | None]]:
    """What was varied -> the scores; None where a simulation failed for technical reasons."""
    groups: dict[str, list[float | None]] = {}
    for one in found.conditions:
        if one.variation != DEFAULT.name:
            quantity = re.sub(r"^[\d.]+ x | [+-]\d+ %$", "", one.variation)
            groups.setdefault(quantity, []).append(one.score)
    if found.others:
        groups["engine"] = [one.score for one in found.others]
    if found.edits.scores:
        groups["design, one edit"] = [*found.edits.scores, *[None] * found.edits.missing]
    return groups


def _row(name: str, scores: Sequence[float | None]) -> dict[str, Any]:
    values = [score for score in scores if score is not None]
    failed = len(scores) - len(values)
    known = {"values": values, "mean": mean_known(values), "count": len(values)}
    return {"name": name, **known, "failed": failed}

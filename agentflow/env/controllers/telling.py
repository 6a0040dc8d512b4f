"""What designers read of controllers after a rollout."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby
from typing import Any

import numpy as np

from agentflow.env.controllers.laws import spans_of
from agentflow.env.controllers.pilot import Pilot
from agentflow.env.feedback.text import number
from agentflow.env.query import CONTROLLERS
from agentflow.env.rollout import Array, Feedback, Moment
from agentflow.machine.controllers.model import Controllers, Law

_HEAD = 'Controllers (queries with the id "controllers" show readings and outputs over time):'
MOST_LAWS, MOST_SPANS = 8, 3
"""Most laws that feedback names; most times at a limit of each, and most broken sensors."""
SHORT = 0.1
"""Shortest time at a limit that feedback names, s."""


def tell_controllers(
    feedback: Feedback, pilot: Pilot, moment: Moment | None, end: float
) -> Feedback:
    """The feedback with what controllers read and did: in words at the start, the decisive moment
    and the end, and as series in its data.

    Args:
        feedback: That of the task.
        pilot: After the rollout.
        moment: The decisive one.
        end: When the rollout ended, s.
    """
    if not pilot.samples:
        return feedback
    laws = pilot.controllers.laws
    times = sorted({0.0, *([moment.time] if moment else [end / 2]), end})
    told = [(name, law) for name, law in laws.items() if law.kind != "constant"][:MOST_LAWS]
    width = 1 + len(pilot.controllers.sensors) + len(laws)
    rows = np.array(pilot.samples).reshape(-1, width)
    nearest = [(time, rows[abs(rows[:, 0] - time).argmin(), 1:].tolist()) for time in times]
    lines = [f"law {name}{_law_text(pilot, name, law, nearest, end)}" for name, law in told]
    lines += [
        f"sensor {name}: block {pilot.controllers.sensors[name].block} broke off at "
        f"{number(time)} s, so it keeps its last reading, {number(value)}"
        for name, (time, value) in [*pilot.lost.items()][:MOST_SPANS]
    ]
    text = "\n".join([feedback.text, _HEAD, *(f"- {line}" for line in lines)])
    return replace(
        feedback, text=text, data={**feedback.data, CONTROLLERS: _series(pilot.controllers, rows)}
    )


def _law_text(
    pilot: Pilot, name: str, law: Law, samples: list[tuple[float, list[float]]], end: float
) -> str:
    sensors, readings = [*pilot.controllers.sensors], []
    read = law.sensors[:1] if law.kind in ("pd", "switch") else ()
    at = len(sensors) + [*pilot.controllers.laws].index(name)
    for time, values in samples:
        sensed = "".join(f"{number(values[sensors.index(each)])} -> " for each in read)
        readings.append(f"{sensed}{number(values[at])} at {number(time)} s")
    what = "".join(f" ({each}" for each in read)
    what += f", target {number(law.target)})" if law.kind == "pd" else ")" * bool(read)
    parts = [f"{what}: {', '.join(readings)}"]
    if entered := pilot.entered.get(name):
        states = [next(group) for _, group in groupby(entered, key=lambda item: item[1])]
        parts.append("state " + ", ".join(f"{state} from {number(t)} s" for t, state in states[:6]))
    spans = [span for span in spans_of(pilot.edges[name], end) if span[1] - span[0] >= SHORT]
    if spans:
        longest = sorted(sorted(spans, key=lambda span: span[0] - span[1])[:MOST_SPANS])
        listed = " and ".join(f"from {number(a)} to {number(b)} s" for a, b in longest)
        parts.append(f"at its limit {listed}")
    return "; ".join(parts)


def _series(controllers: Controllers, rows: Array) -> dict[str, Any]:
    """Readings of sensors and outputs of laws over time, as JSON data; rows are times and these."""
    times, *columns = _rounded(rows.T, [3] + [4] * (rows.shape[1] - 1))
    laws = controllers.laws
    return {
        "times": times,
        "sensors": dict(zip(controllers.sensors, columns, strict=False)),
        "laws": dict(zip(laws, columns[-len(laws) :], strict=True)),
        "targets": {name: law.target for name, law in laws.items() if law.kind == "pd"},
    }


def _rounded(rows: Array, digits: list[int]) -> list[list[float]]:
    """Each row with so many digits, as `round` does, in a tenth of its time."""
    units = 10.0 ** np.array(digits)[:, np.newaxis]
    scaled = rows * units
    near = np.rint(scaled)
    with np.errstate(invalid="ignore"):
        plain = (abs(scaled - near) < 0.499) & (abs(scaled) < 1e12)
    found: list[list[float]] = (near / units).tolist()
    if not plain.all():
        for row, column in np.argwhere(~plain).tolist():
            found[row][column] = round(rows[row, column].item(), digits[row])
    return found

"""What designers read of controllers after a rollout."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby
from typing import Any

from agentflow.env.controllers.laws import spans_of
from agentflow.env.controllers.pilot import Pilot
from agentflow.env.feedback.text import number
from agentflow.env.query import CONTROLLERS
from agentflow.env.rollout import Feedback, Moment
from agentflow.machine.controllers.model import Law

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
    lines = [f"law {name}{_law_text(pilot, name, law, times, end)}" for name, law in told]
    lines += [
        f"sensor {name}: block {pilot.controllers.sensors[name].block} broke off at "
        f"{number(time)} s, so it keeps its last reading, {number(value)}"
        for name, (time, value) in [*pilot.lost.items()][:MOST_SPANS]
    ]
    text = "\n".join([feedback.text, _HEAD, *(f"- {line}" for line in lines)])
    return replace(feedback, text=text, data={**feedback.data, CONTROLLERS: series_of(pilot)})


def _law_text(pilot: Pilot, name: str, law: Law, times: list[float], end: float) -> str:
    sensors, readings = [*pilot.controllers.sensors], []
    read = law.sensors[:1] if law.kind in ("pd", "switch") else ()
    at = [*pilot.controllers.laws].index(name)
    for time in times:
        _, values, outputs = min(pilot.samples, key=lambda sample: abs(sample[0] - time))
        sensed = "".join(f"{number(values[sensors.index(each)])} -> " for each in read)
        readings.append(f"{sensed}{number(outputs[at])} at {number(time)} s")
    what = "".join(f" ({each}" for each in read)
    what += f", target {number(law.target)})" if law.kind == "pd" else ")" * bool(read)
    parts = [f"{what}: {', '.join(readings)}"]
    if entered := pilot.laws.entered.get(name):
        states = [next(group) for _, group in groupby(entered, key=lambda item: item[1])]
        parts.append("state " + ", ".join(f"{state} from {number(t)} s" for t, state in states[:6]))
    spans = [span for span in spans_of(pilot.laws.edges[name], end) if span[1] - span[0] >= SHORT]
    if spans:
        longest = sorted(sorted(spans, key=lambda span: span[0] - span[1])[:MOST_SPANS])
        listed = " and ".join(f"from {number(a)} to {number(b)} s" for a, b in longest)
        parts.append(f"at its limit {listed}")
    return "; ".join(parts)


def series_of(pilot: Pilot) -> dict[str, Any]:
    """Readings of sensors and outputs of laws over time, as JSON data."""
    times, readings, outputs = zip(*pilot.samples, strict=True)
    names = (
        ("sensors", pilot.controllers.sensors, readings),
        ("laws", pilot.controllers.laws, outputs),
    )
    return {
        "times": [round(time, 3) for time in times],
        **{
            key: {name: [round(row[at], 4) for row in rows] for at, name in enumerate(known)}
            for key, known, rows in names
        },
        "targets": {
            name: law.target for name, law in pilot.controllers.laws.items() if law.kind == "pd"
        },
    }

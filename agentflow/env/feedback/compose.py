"""Puts feedback together: score, the family's lines, what is told of every rollout, then paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from agentflow.env.feedback.contacts import contact_line, telling
from agentflow.env.feedback.energy import energy_lines
from agentflow.env.feedback.loads import broken_lines, load_lines
from agentflow.env.feedback.orientation import frame_text, orientation_runs, orientation_text
from agentflow.env.feedback.stalls import stall_lines
from agentflow.env.feedback.text import Series, number, spacing
from agentflow.env.rollout import Broken, Feedback, Trace, Verdict
from agentflow.machine.tree import Machine


def compose(
    machine: Machine,
    trace: Trace,
    broken: Sequence[Broken],
    verdict: Verdict,
    unit: str,
    lines: Sequence[str],
    data: Mapping[str, Any],
    paths: Sequence[Series],
) -> Feedback:
    """Compose a family's feedback: score, its own lines, the shared lines, then paths.

    Args:
        machine: The simulated machine.
        trace: Its trace.
        broken: Broken connections in order of time.
        verdict: Score, terms, events and the decisive moment.
        unit: Unit of the score; "" for none.
        lines: The family's own lines, each "Key: ...".
        data: The family's own data; overrides shared keys.
        paths: Series at the end of the text.
    """
    even, measured, moment = trace.even, trace.measured, verdict.moment
    end = float(trace.times[-1])
    contacts = telling(measured.contacts, moment, end)
    runs = orientation_runs(even)
    stalls = [event for event in verdict.events if event.kind == "motor_stalled"]
    text = [
        f"Score: {number(verdict.score)} {unit}".rstrip(),
        *lines,
        *energy_lines(machine, measured.energy, moment),
        *contact_line(contacts, end),
        *broken_lines(machine, broken),
        *load_lines(measured.peaks, moment),
        *stall_lines(stalls),
        "Orientation of block 0: " + orientation_text(runs, spacing(even.times)),
        "Frames: " + frame_text(machine, trace),
        *(path.text for path in paths),
    ]
    # vars, as asdict would copy every number
    shared = {
        "score": verdict.score,
        "terms": dict(verdict.terms),
        "moment": None if moment is None else dict(vars(moment)),
        "seconds": end,
        "broken": [dict(vars(item)) for item in broken],
        "orientation": [{"faces": word, "from": start, "to": end} for word, start, end in runs],
        "events": [vars(event) | {"blocks": list(event.blocks)} for event in verdict.events],
        "series": [dict(vars(path)) for path in paths],
        "energy": None if measured.energy is None else dict(vars(measured.energy)),
        "peaks": [dict(vars(peak)) for peak in measured.peaks],
        "contacts": [dict(vars(contact)) for contact in contacts],
    }
    return Feedback("\n".join(text), {**shared, **data})

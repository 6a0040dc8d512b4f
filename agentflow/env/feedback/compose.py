"""Puts feedback together: score, the family's lines, the lines of every rollout, then paths."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

from agentflow.env.feedback.separation import find_fragments, fragment_lines
from agentflow.env.feedback.stalls import stall_lines
from agentflow.env.feedback.text import (
    Series,
    block_name,
    body_name,
    frame_text,
    number,
    object_label,
    orientation_runs,
    orientation_text,
    rounded,
    settled_lines,
    spacing,
    vector_text,
)
from agentflow.env.measurements import Contact, Energy, Named, Peak
from agentflow.env.rollout import Broken, Feedback, Moment, Trace, Verdict
from agentflow.machine.tree import Machine

LEAST_WORK = 50.0
"""Less work than this is not reported, J."""
MOST_CONTACTS = 4
"""Most contacts in the text; the data holds all."""
LEAST_SHARE = 0.1
"""Hits with a smaller share of the hardest hit's impulse are not reported."""
AT_END = 0.2
"""How long before the end bodies must have touched to count as touching at the end, s."""
HELD = 0.5
"""How long they must have touched for that, s."""
APART = 0.05
"""How much later than the first touch the hardest hit is reported separately, s."""
MOST_BREAKAGES = 5
"""Most breakages that get their own line of text; the data holds all."""
TELLING, TELLING_AFTER, LEAST_LOAD = 0.3, 0.5, 0.05
"""Load over strength above which peaks up to the decisive moment are reported, those after it, and
the highest one in any case."""
_SETTLING = " (while it settled, before t = 0)"


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
    contacts = explanatory(measured.contacts, moment, end)
    fragments = find_fragments(machine, trace)
    runs = orientation_runs(even)
    stalls = [event for event in verdict.events if event.kind == "motor_stalled"]
    text = [
        f"Score: {number(verdict.score)} {unit}".rstrip(),
        *lines,
        *_energy_lines(machine, measured.energy, moment),
        *contact_line(contacts, end),
        *broken_lines(machine, broken),
        *fragment_lines(fragments),
        *load_lines(measured.peaks, moment),
        *stall_lines(stalls),
        "Orientation of block 0: " + orientation_text(runs, spacing(even.times)),
        "Frames: " + frame_text(machine, trace),
        *settled_lines(machine, trace),
        *(path.text for path in paths),
    ]
    # vars, as asdict would copy every number
    shared = {
        "score": verdict.score,
        "terms": dict(verdict.terms),
        "moment": None if moment is None else dict(vars(moment)),
        "seconds": end,
        "broken": [dict(vars(item)) for item in broken],
        "fragments": [vars(item) | {"blocks": list(item.blocks)} for item in fragments],
        "orientation": [{"faces": word, "from": start, "to": end} for word, start, end in runs],
        "events": [vars(event) | {"blocks": list(event.blocks)} for event in verdict.events],
        "series": [dict(vars(path)) for path in paths],
        "energy": None if measured.energy is None else dict(vars(measured.energy)),
        "peaks": [dict(vars(peak)) for peak in measured.peaks],
        "recoil": [dict(vars(peak)) for peak in measured.recoil],
        "pulls": [dict(vars(pull)) for pull in measured.pulls],
        "contacts": [dict(vars(contact)) for contact in contacts],
    }
    return Feedback("\n".join(text), {**shared, **data})


def _energy_lines(machine: Machine, energy: Energy | None, moment: Moment | None) -> list[str]:
    """What did work until the decisive moment, and what moves then; [] if nothing moved."""
    if energy is None:
        return []
    works = ((name, getattr(energy, name)) for name in ("springs", "motors", "gravity", "air"))
    told = [f"{name} {rounded(work)}" for name, work in works if abs(work) >= LEAST_WORK]
    if not told:
        return []
    when = f"{moment.name} at {number(energy.time)} s" if moment else f"{number(energy.time)} s"
    moving = f"machine {rounded(energy.machine)}"
    if moment is not None and moment.body is not None:
        moving = f"{body_name(machine, moment.body)} {rounded(energy.thrown)}, rest of the {moving}"
    lost = rounded(max(energy.lost, 0.0))
    return [
        f"Energy until {when} (J): work of {', '.join(told)}; "
        f"kinetic energy of {moving}; lost {lost}"
    ]


def explanatory(contacts: Sequence[Contact], moment: Moment | None, end: float) -> list[Contact]:
    """The contacts that explain most, in order of time; `end` is that of the rollout, s.

    Those of what is thrown come first, then what still holds the machine at the end (such as a wall
    that stopped it), then by impulse.
    """
    body = None if moment is None else moment.body

    def rank(contact: Contact) -> tuple[bool, bool, float]:
        ours = body in (contact.a, contact.b)
        return not ours, ours or not _holds(contact, end), -contact.hardest.impulse

    ranked = sorted((each for each in contacts if not each.standing), key=rank)
    most = max((each.hardest.impulse for each in ranked), default=0.0)
    told = [
        each
        for each in ranked[:MOST_CONTACTS]
        if _holds(each, end) or each.hardest.impulse >= LEAST_SHARE * most
    ]
    return sorted(told, key=lambda each: each.first.time)


def _holds(contact: Contact, end: float) -> bool:
    """Whether something other than the ground has touched for long and still does at the end."""
    lasting = contact.last > end - AT_END and contact.last > contact.first.time + HELD
    return lasting and isinstance(contact.b, str) and contact.b != "ground"


def contact_line(contacts: Sequence[Contact], end: float) -> list[str]:
    """One line; [] without contacts to report."""
    parts = "; ".join(_contact_text(each, end) for each in contacts)
    return [f"Contacts (impulse in N s, place): {parts}"] if parts else []


def _contact_text(contact: Contact, end: float) -> str:
    first, hardest = contact.first, contact.hardest
    place = ", ".join(number(value, 1) for value in hardest.place)
    when = f"at {number(first.time)} s"
    if hardest.time > first.time + APART:
        when += f", hardest at {number(hardest.time)} s"
    if _holds(contact, end):
        when += ", until the end"
    return f"{_name(contact.a)} on {_name(contact.b)} {when}: {rounded(hardest.impulse)} ({place})"


def _name(body: Named) -> str:
    return object_label(body) if isinstance(body, str) else f"block {body}"


def broken_lines(machine: Machine, broken: Sequence[Broken]) -> list[str]:
    """The connections that broke, in order of time."""
    if not broken:
        return ["Broken: none"]
    lines = [
        f"Broken: {block_name(machine, item.block)} off block {item.partner} at "
        f"{number(item.time)} s{_SETTLING if item.time < 0.0 else ''}, load {number(item.load)} "
        f"(force, moment: {_wrench_text(item)})"
        for item in broken[:MOST_BREAKAGES]
    ]
    if rest := ", ".join(f"{item.block} off {item.partner}" for item in broken[MOST_BREAKAGES:]):
        lines.append(f"Broken later: {rest}")
    return lines


def load_lines(peaks: Sequence[Peak], moment: Moment | None) -> list[str]:
    """The connections that held with the highest loads, up to and after the decisive moment."""
    lines: list[str] = []
    for after, group in groupby(peaks, key=lambda peak: peak.after):
        found = [peak for peak in group if peak.load < 1.0]
        least = TELLING_AFTER if after else TELLING
        told = [peak for peak in found if peak.load >= least] or found[: not after]
        when = f" {'after' if after else 'up to'} {moment.name}" if moment else ""
        if told and told[0].load >= LEAST_LOAD:
            parts = "; ".join(
                f"{peak.block}-{peak.partner} {number(peak.load)} at {number(peak.time)} s: "
                + _wrench_text(peak)
                for peak in told
            )
            note = "" if lines else " (share of strength: force N, moment N m; breaks at 1)"
            lines.append(f"Highest loads{when}{note}: {parts}")
    return lines


def _wrench_text(item: Peak | Broken) -> str:
    return f"{vector_text(item.force)}, {vector_text(item.moment)}"

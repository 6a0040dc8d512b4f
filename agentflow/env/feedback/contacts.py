"""Which contacts explain a rollout: hits by or on what is thrown, on walls and rims, and falls."""

from __future__ import annotations

from collections.abc import Sequence

from agentflow.env.feedback.text import number, rounded, thing_name
from agentflow.env.measurements import Contact, Named
from agentflow.env.rollout import Moment

MOST = 4
"""Most contacts in the text; the data holds all."""
SHARE = 0.1
"""Hits with a smaller share of the hardest hit's impulse are not told."""
LATER = 0.05
"""How much later than the first touch the hardest hit is told apart, s."""


def telling(contacts: Sequence[Contact], moment: Moment | None) -> list[Contact]:
    """The contacts that explain most, in order of time."""
    body = None if moment is None else moment.body
    ranked = sorted(filter(_tells, contacts), key=lambda each: _rank(each, body))
    most = max((each.hardest.impulse for each in ranked), default=0.0)
    told = [each for each in ranked[:MOST] if each.hardest.impulse >= SHARE * most]
    return sorted(told, key=lambda each: each.first.time)


def contact_lines(contacts: Sequence[Contact], moment: Moment | None) -> list[str]:
    """One line; [] if no contact tells anything."""
    parts = "; ".join(map(_text, telling(contacts, moment)))
    return [f"Contacts (impulse in N s, place): {parts}"] if parts else []


def _tells(contact: Contact) -> bool:
    """Whether a contact is more than something that stands or lies from the start."""
    return not contact.standing


def _rank(contact: Contact, body: Named | None) -> tuple[bool, float]:
    return body not in (contact.a, contact.b), -contact.hardest.impulse


def _text(contact: Contact) -> str:
    first, hardest = contact.first, contact.hardest
    place = ", ".join(number(value, 1) for value in hardest.place)
    when = f"at {number(first.time)} s"
    if hardest.time > first.time + LATER:
        when += f", hardest at {number(hardest.time)} s"
    return f"{_name(contact.a)} on {_name(contact.b)} {when}: {rounded(hardest.impulse)} ({place})"


def _name(body: Named) -> str:
    return thing_name(body) if isinstance(body, str) else f"block {body}"

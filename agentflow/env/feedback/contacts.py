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
END = 0.2
"""How long before the end bodies must have touched to count as touching at the end, s."""
LASTING = 0.5
"""How long they must have touched for that, s."""
LATER = 0.05
"""How much later than the first touch the hardest hit is told apart, s."""


def telling(contacts: Sequence[Contact], moment: Moment | None, end: float) -> list[Contact]:
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
        each for each in ranked[:MOST] if _holds(each, end) or each.hardest.impulse >= SHARE * most
    ]
    return sorted(told, key=lambda each: each.first.time)


def _holds(contact: Contact, end: float) -> bool:
    """Whether something other than the ground has touched for long and still does at the end."""
    lasting = contact.last > end - END and contact.last > contact.first.time + LASTING
    return lasting and isinstance(contact.b, str) and contact.b != "ground"


def contact_line(contacts: Sequence[Contact], end: float) -> list[str]:
    """One line; [] if no contact tells anything."""
    parts = "; ".join(_text(each, end) for each in contacts)
    return [f"Contacts (impulse in N s, place): {parts}"] if parts else []


def _text(contact: Contact, end: float) -> str:
    first, hardest = contact.first, contact.hardest
    place = ", ".join(number(value, 1) for value in hardest.place)
    when = f"at {number(first.time)} s"
    if hardest.time > first.time + LATER:
        when += f", hardest at {number(hardest.time)} s"
    if _holds(contact, end):
        when += ", until the end"
    return f"{_name(contact.a)} on {_name(contact.b)} {when}: {rounded(hardest.impulse)} ({place})"


def _name(body: Named) -> str:
    return thing_name(body) if isinstance(body, str) else f"block {body}"

"""What is measured in a session besides behaviour: order of building, restarts, use of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from agentflow.app.inspect.behaviour import moving_types
from agentflow.machine import Machine, place
from agentflow.machine.geometry.balance import stands
from agentflow.study.episodes import Episode, Label
from agentflow.study.session import Action, Session

FOUNDATION = 2
"""Blocks that do not move which make a foundation, without the given ones; chosen."""
SMALLEST = 4
"""Blocks of the smallest machine that can be begun anew, without the given ones; chosen."""
KEPT = 0.25
"""Greatest share of these blocks that is left when a machine is begun anew; chosen."""
ROLES: Mapping[Label, str] = {
    "Plan": "meta_designer",
    "Hypothesize": "meta_designer",
    "Build": "designer",
    "Observe": "inspector",
    "Diagnose": "inspector",
    "Reflect": "inspector",
    "Revise": "refiner",
    "Restructure": "refiner",
    "Query": "querier",
}
"""Label -> role whose work this is. Simulation is nobody's, so Test has none."""


def machine_at(session: Session, time: float) -> Machine:
    """The machine of a session at a time, s, before what is done then."""
    done = [action for action in session.of(Action) if action.at < time]
    return session.machine(done[-1] if done else session.start)


def is_foundation_first(session: Session) -> bool | None:
    """Whether the person made a foundation before the first block that moves.

    None without such a block, or if it came with a whole machine of somebody else.
    """
    given = session.machine(session.start)
    before = given
    for action in session.of(Action):
        after = session.machine(action)
        if moving_types(after) - moving_types(given):
            taken = action.do in ("open", "refine")
            return None if taken else has_foundation(before, given)
        before = after
    return None


def builds_foundation_first(machine: Machine, given: Machine) -> bool | None:
    """The same for a machine whose blocks were attached in the order of their ids."""
    known = moving_types(given)
    for count in range(len(given) + 1, len(machine) + 1):
        if moving_types(Machine(machine.steps[:count])) - known:
            return has_foundation(Machine(machine.steps[: count - 1]), given)
    return None


def has_foundation(machine: Machine, given: Machine) -> bool:
    """Whether a machine stands, and has enough blocks besides the given ones."""
    return len(machine) - len(given) >= FOUNDATION and stands(place(machine))


def count_restarts(sizes: Sequence[int]) -> int:
    """How often a machine was begun anew.

    Args:
        sizes: Its numbers of blocks in the order of time, without the given ones.
    """
    greatest = count = 0
    for size in sizes:
        greatest = max(greatest, size)
        if greatest >= SMALLEST and size <= KEPT * greatest:
            count, greatest = count + 1, size
    return count


def session_restarts(session: Session) -> int:
    """How often the machine of a session was begun anew."""
    given = len(session.machine(session.start))
    made = map(session.machine, session.of(Action))
    return count_restarts([len(machine) - given for machine in made])


def time_of_roles(episodes: Sequence[Episode]) -> dict[str, float]:
    """Role -> seconds of work like that of the role; episodes without a label are left out."""
    found = dict.fromkeys(ROLES.values(), 0.0)
    for episode in episodes:
        role = None if episode.label is None else ROLES.get(episode.label)
        if role is not None:
            found[role] += episode.seconds
    return {role: seconds for role, seconds in found.items() if seconds}

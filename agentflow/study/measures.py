"""What is measured in a session: behaviour, order, restarts, time, kind of design."""

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from itertools import pairwise

import yaml

from agentflow.agents.registry import ROLES
from agentflow.agents.replies import expectations
from agentflow.app.inspect.behaviour import Machines, moving_types
from agentflow.app.tasks import find_task
from agentflow.machine import Machine, place
from agentflow.machine.geometry.balance import stands
from agentflow.metrics.behaviour import Behaviour, Edit, behaviour
from agentflow.runs.events import EvaluationEvent
from agentflow.runs.locations import Location
from agentflow.study.episodes import Episode, Utterance
from agentflow.study.session import Action, Session, StudioTest

FOUNDATION = 2
"""Blocks that do not move which make a foundation, without the given ones; chosen."""
SMALLEST = 4
"""Blocks of the smallest machine that can be started over, without the given ones; chosen."""
KEPT = 0.25
"""Greatest share of these blocks that is left when a machine is started over; chosen."""


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
    """How often a machine was started over.

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
    """How often the machine of a session was started over."""
    given = len(session.machine(session.start))
    made = map(session.machine, session.of(Action))
    return count_restarts([len(machine) - given for machine in made])


def time_of_roles(episodes: Sequence[Episode]) -> dict[str, float]:
    """Role -> seconds of work like that of the role, by the first role whose label an episode has.

    Episodes without a label are left out, and those of testing: simulation is not any role's work.
    """
    found = dict.fromkeys(ROLES, 0.0)
    for episode in episodes:
        role = next((name for name in ROLES if episode.label in ROLES[name].labels), None)
        if role is not None:
            found[role] += episode.seconds
    return {role: seconds for role, seconds in found.items() if seconds}


def design_type(text: str) -> str | None:
    """The type whose words are used most often; of several, the one that is named first.

    None if no word of any type is used.
    """
    used: dict[str, int] = {}
    for word in re.findall(r"[a-z]+", text.lower()):
        if kind := _types().get(word):
            used[kind] = used.get(kind, 0) + 1
    return max(used, key=lambda kind: used[kind], default=None)


@cache
def _types() -> Mapping[str, str]:
    """Word -> type, with the forms of each word."""
    listed = yaml.safe_load((files("agentflow.study") / "designs.yaml").read_text("utf-8"))
    return {
        word + ending: kind
        for kind, words in listed.items()
        for word in words
        for ending in ("", "s", "es", "ed", "er", "ers", "ing")
    }


def behaviour_of_session(
    session: Session, said: Sequence[Utterance], effort: Mapping[str, float]
) -> Behaviour:
    """How the person of a session behaves, by the same rules as the designers of runs.

    A prediction of an edit is what was said or noted between two trials, in sentences that say what
    is expected.

    Args:
        session: The session.
        said: Everything that was said or noted.
        effort: Role -> seconds of work like that of the role.
    """
    trials = session.of(StudioTest)

    def prediction(place: Location) -> str:
        begin, end = trials[place.call - 1].end, trials[place.call].at
        return expectations("\n".join(one.text for one in said if begin <= one.begin < end))

    return behaviour(
        list(edits_of(session)),
        prediction,
        Machines(session.machines.__getitem__),
        effort,
        metres=find_task(session.start.task).brief.greatest is None,
    )


def edits_of(session: Session) -> Iterator[Edit]:
    """An edit leads from each trial to the next; its location has the number of the former.

    Those are left out that changed nothing, or whose simulation crashed or timed out.
    """
    results = [result_of(session, trial) for trial in session.of(StudioTest)]
    for number, (before, after) in enumerate(pairwise(results), start=1):
        if before.machine != after.machine and None not in (before.score, after.score):
            yield Edit((Location("trial", call=number),), before, after, informed=True)


def result_of(session: Session, trial: StudioTest) -> EvaluationEvent:
    """A trial as the result of a simulation."""
    return EvaluationEvent(
        Location("trial"),
        machine=session.machine(trial).digest,
        valid=trial.status != "invalid",
        score=trial.score,
        status=trial.status,
        broken=(),
        rollout=None,
    )

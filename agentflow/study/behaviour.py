"""How a person behaves in a session, by the same rules as the designers of runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from agentflow.app.inspect.behaviour import Machines
from agentflow.app.tasks import find_task
from agentflow.metrics.behaviour.measures import Behaviour, Edit, behaviour
from agentflow.metrics.behaviour.predictions import expectations
from agentflow.runs.events import EvaluationEvent
from agentflow.runs.places import Place
from agentflow.study.session import Session, Trial
from agentflow.study.transcript import Utterance


def behaviour_of_session(
    session: Session, said: Sequence[Utterance], effort: Mapping[str, float]
) -> Behaviour:
    """How the person of a session behaves.

    A prediction of an edit is what was said or noted between two trials, in sentences that say what
    is expected.

    Args:
        session: The session.
        said: Everything that was said or noted.
        effort: Role -> seconds of work like that of the role.
    """
    trials = session.of(Trial)

    def prediction(place: Place) -> str:
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
    """An edit leads from each trial to the next; its place is the number of the former.

    Those are left out that changed nothing, or whose simulation crashed or timed out.
    """
    results = [result_of(session, trial) for trial in session.of(Trial)]
    for number, (before, after) in enumerate(pairwise(results), start=1):
        if before.machine != after.machine and None not in (before.score, after.score):
            yield Edit((Place("trial", call=number),), before, after, informed=True)


def result_of(session: Session, trial: Trial) -> EvaluationEvent:
    """A trial as the result of a simulation."""
    return EvaluationEvent(
        Place("trial"),
        machine=session.machine(trial).digest,
        valid=trial.status != "invalid",
        score=trial.score,
        status=trial.status,
        broken=(),
        rollout=None,
    )

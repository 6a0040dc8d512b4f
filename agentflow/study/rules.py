"""Labels episodes by rules on actions alone; what was said is not read."""

from __future__ import annotations

from collections.abc import Sequence

from agentflow.app.inspect.behaviour import moving_types
from agentflow.metrics.behaviour.measures import fails
from agentflow.study.behaviour import edits_of, result_of
from agentflow.study.episodes import ALLOWED, Episode, Label
from agentflow.study.measures import count_restarts, machine_at
from agentflow.study.session import Session, Trial

THINKING = ("pause", "talking")


def label_by_rules(session: Session, episodes: Sequence[Episode]) -> list[Episode]:
    """The episodes with their labels; breaks have none.

    * Building before the first trial is Build. Later it is Restructure if the types of moving
      blocks change or the machine is begun anew, else Revise.
    * A pause or talk before anything is built is Plan. It is Reflect if only such follow.
    * Right after a trial or a look at one, it is Diagnose if the last trial failed, else Observe.
    * All others are Plan before the first trial, and Hypothesize later.
    """
    rules = _Rules(session, episodes)
    return [
        episode.model_copy(update={"label": rules.label(number)})
        for number, episode in enumerate(episodes)
    ]


class _Rules:
    def __init__(self, session: Session, episodes: Sequence[Episode]) -> None:
        self._session, self._episodes = session, episodes
        self._trials = session.of(Trial)
        self._worse = {edit.after.machine for edit in edits_of(session) if edit.failed}

    def label(self, number: int) -> Label | None:
        episode = self._episodes[number]
        if episode.coarse == "building":
            return self._label_building(episode)
        if episode.coarse in THINKING:
            return self._label_thinking(number)
        return next(iter(ALLOWED[episode.coarse]), None)

    def _label_building(self, episode: Episode) -> Label:
        if not self._last_trial(episode):
            return "Build"
        before = machine_at(self._session, episode.begin)
        after = machine_at(self._session, episode.end)
        given = len(self._session.machine(self._session.start))
        anew = count_restarts([len(before) - given, len(after) - given])
        return "Restructure" if anew or moving_types(before) != moving_types(after) else "Revise"

    def _label_thinking(self, number: int) -> Label:
        done = [one.coarse for one in self._episodes[:number]]
        to_come = {one.coarse for one in self._episodes[number + 1 :]}
        trial = self._last_trial(self._episodes[number])
        if "building" not in done and not trial:
            return "Plan"
        if to_come <= {*THINKING, "break"}:
            return "Reflect"
        if trial and done[-1] in ("testing", "looking"):
            return "Diagnose" if self._failed(trial) else "Observe"
        return "Hypothesize" if trial else "Plan"

    def _last_trial(self, episode: Episode) -> Trial | None:
        return next((one for one in reversed(self._trials) if one.at < episode.begin), None)

    def _failed(self, trial: Trial) -> bool:
        result = result_of(self._session, trial)
        return trial.score is None or fails(result) or result.machine in self._worse

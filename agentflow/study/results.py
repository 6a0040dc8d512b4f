"""What is measured in sessions and runs of agents, in one table; who worked in a similar order."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, groupby
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rapidfuzz.distance import Levenshtein
from scipy.cluster.hierarchy import fcluster, linkage
from sklearn.metrics import silhouette_score

from agentflow.agents.registry import ROLES
from agentflow.app.design.execution import best_machine
from agentflow.app.design.plan import task_of_run
from agentflow.app.inspect.behaviour import Result, behaviour_columns, behaviour_of, working_roles
from agentflow.errors import RunError
from agentflow.metrics.tables import Column, Row, Table
from agentflow.runs import find_runs, read_document, read_result
from agentflow.runs.events import (
    AttemptEvent,
    BlueprintEvent,
    EvaluationEvent,
    ToolEvent,
    read_typed_events,
)
from agentflow.study import measures
from agentflow.study.segments import everything_said, read_segments
from agentflow.study.session import FILE, Session, StudioTest, read_session
from agentflow.tools.bench import TOOLS

FEWEST = 3
"""Sequences; of two, nothing can be said about clusters."""


def condense(labels: Sequence[str]) -> tuple[str, ...]:
    """A sequence in which no label follows itself."""
    return tuple(label for label, _ in groupby(labels))


def find_clusters(sequences: Sequence[Sequence[str]]) -> list[int] | None:
    """Number of the cluster of each sequence, from 1 in the order of their first sequences.

    Distances are Levenshtein's over the length of the longer sequence; clusters are joined by
    average linkage. Their number, from 2 to one less than that of sequences, is that with the
    highest mean silhouette; of equal ones, the lowest. If all sequences are equal, there is one.

    None for fewer than three sequences.
    """
    if len(sequences) < FEWEST:
        return None
    distances = [Levenshtein.normalized_distance(a, b) for a, b in combinations(sequences, 2)]
    if not any(distances):
        return [1] * len(sequences)
    tree = linkage(distances, method="average")
    square = np.zeros((len(sequences), len(sequences)))
    square[np.triu_indices(len(sequences), k=1)] = distances
    square += square.T
    best, found = -np.inf, [1] * len(sequences)
    for wanted in range(2, len(sequences)):
        clusters = [int(number) for number in fcluster(tree, wanted, criterion="maxclust")]
        if len(set(clusters)) < 2:  # equal distances cannot be distinguished
            continue
        fit = float(silhouette_score(square, clusters, metric="precomputed"))
        if fit > best + 1e-9:
            best, found = fit, clusters
    order = {old: new for new, old in enumerate(dict.fromkeys(found), start=1)}
    return [order[old] for old in found]


ABOUT = (
    "Best, final: scores. Foundation first: it stood, with 2 blocks or more, before the first "
    "block that moves. Restarts: machines that were started over. Effort: of people, share of "
    "time; of agents, of tokens. Cluster: similar sequences of labels. The other columns are "
    "those of agentflow behaviour. docs/how-to/studies.md has the rules."
)
LABEL_OF_TOOL = {tool.spec.name: tool.label for tool in TOOLS if tool.label}
"""Tool of a call -> label in the sequence of its run; others have none."""


@dataclass(frozen=True)
class Measured:
    """A session or a run, and what is measured in it.

    `by` is a person, or the model of a run. `trials` are simulated machines, and `final` is the
    score of the last trial of a person, or of the result of a run. `restarts` is None for runs,
    which have several machines at a time. `labels` are in the order of time, and none follows
    itself; `labelled_by` is the model that labelled a session, "" for runs, whose labels follow
    from their roles.
    """

    result: Result
    by: str
    effort_in: Literal["seconds", "tokens"]
    task: str
    trials: int
    best: float | None
    final: float | None
    foundation_first: bool | None
    restarts: int | None
    design: str | None
    labels: tuple[str, ...]
    labelled_by: str
    unlabelled: int
    cluster: int | None = None

    def to_json(self) -> dict[str, Any]:
        """All numbers as JSON data."""
        own = {key: value for key, value in vars(self).items() if key != "result"}
        behaviour = self.result.to_json()
        effort = behaviour.pop("effort")
        spent = {own.pop("effort_in"): effort["tokens"], "shares": effort["shares"]}
        return {**behaviour, **own, "effort": spent}

    def row(self, roles: Sequence[str]) -> Row:
        """A line of the table."""
        first = {None: None, True: "yes", False: "no"}[self.foundation_first]
        return Row(
            (self.result.source, self.by, self.task),
            (self.trials, self.best, self.final, first, self.restarts,
             *self.result.row(roles).values, self.design, self.cluster),
        )  # fmt: skip


def measure(paths: Iterable[Path]) -> list[Measured]:
    """Every session and run at or below some paths, with their clusters.

    Raises:
        RunError: A path holds neither, or one is damaged or unfinished.
    """
    found = [one for path in paths for one in _measure(path)]
    clusters = find_clusters([one.labels for one in found])
    if clusters is None:
        return found
    return [replace(one, cluster=number) for one, number in zip(found, clusters, strict=True)]


def _measure(path: Path) -> Iterator[Measured]:
    sessions = list(find_sessions(path))
    runs = list(find_runs(path))
    if not sessions and not runs:
        raise RunError(f"{path} holds no session and no run")
    for folder in sessions:
        yield measure_session(read_session(folder))
    for run in runs:
        yield measure_run(run)


def find_sessions(path: Path) -> Iterator[Path]:
    """The folders of sessions at or below a path, by name."""
    if path.name == FILE:
        yield path
    elif path.is_dir():
        yield from sorted(file.parent for file in path.rglob(FILE))


def measure_session(session: Session) -> Measured:
    """What is measured in a session."""
    segments = read_segments(session)
    said = everything_said(session, segments)
    scores = [trial.score for trial in session.of(StudioTest) if trial.score is not None]
    found = measures.behaviour_of_session(session, said, measures.time_of_roles(segments.episodes))
    return Measured(
        Result(str(session.path), 1, found),
        by="person",
        effort_in="seconds",
        task=session.start.task,
        trials=len(session.of(StudioTest)),
        best=max(scores, default=None),
        final=scores[-1] if scores else None,
        foundation_first=measures.is_foundation_first(session),
        restarts=measures.session_restarts(session),
        design=measures.design_type(" ".join(one.text for one in said)),
        labels=condense([one.label for one in segments.episodes if one.label]),
        labelled_by=segments.model,
        unlabelled=segments.unlabelled,
    )


def measure_run(path: Path) -> Measured:
    """What is measured in a finished run."""
    result, task = read_result(path), task_of_run(path, read_document(path))
    events = list(read_typed_events(path))
    tried = {e.machine: e.score for e in events if isinstance(e, EvaluationEvent)}
    machine = best_machine(result)
    first = None if machine is None else measures.builds_foundation_first(machine, task.brief.given)
    plans = [event.definition for event in events if isinstance(event, BlueprintEvent)]
    return Measured(
        Result(str(path), 1, behaviour_of(path)),
        by=result.model,
        effort_in="tokens",
        task=task.name,
        trials=len(tried),
        best=max((score for score in tried.values() if score is not None), default=None),
        final=result.score,
        foundation_first=first,
        restarts=None,
        design=measures.design_type(" ".join(plans)),
        labels=condense([label for event in events if (label := _label(event))]),
        labelled_by="",
        unlabelled=0,
    )


def _label(event: object) -> str | None:
    if isinstance(event, EvaluationEvent):
        return "Test"
    if isinstance(event, AttemptEvent):
        labels = ROLES[event.role].labels if event.role in ROLES else ()
        return labels[0] if labels else None
    return LABEL_OF_TOOL.get(event.tool) if isinstance(event, ToolEvent) else None


def results_table(results: Sequence[Measured]) -> Table:
    """The results in lines."""
    roles = working_roles(one.result for one in results)
    columns = (
        *(Column("", name) for name in ("trials", "best", "final")),
        *(Column("", name) for name in ("foundation first", "restarts")),
        *behaviour_columns(roles, "effort"),
        *(Column("", name) for name in ("design", "cluster")),
    )
    rows = tuple(one.row(roles) for one in results)
    heads = ("source", "by", "task")
    notes = (ABOUT, *_label_notes(results))
    return Table("Designers", heads, columns, rows, notes=notes)


def _label_notes(results: Sequence[Measured]) -> Iterator[str]:
    """Who labelled the sessions, and how many episodes have no label."""
    for labelled_by in dict.fromkeys(one.labelled_by for one in results if one.labelled_by):
        own = [one.unlabelled for one in results if one.labelled_by == labelled_by]
        lost = f"; {sum(own)} episodes have no label" if any(own) else ""
        sessions = "1 session" if len(own) == 1 else f"{len(own)} sessions"
        yield f"Labels of {sessions} are from {labelled_by}{lost}."

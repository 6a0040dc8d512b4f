"""How the designers of runs behave, and the table of it."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

from agentflow.agents.registry import ROLES
from agentflow.app.design.plan import RunPlan, engine_of_run
from agentflow.diversity.topology import tree_edit_distance
from agentflow.env.physics.engines import usable_engine
from agentflow.errors import RunError
from agentflow.machine import Machine, library
from agentflow.metrics.behaviour import Behaviour, agent_edits, behaviour, edits
from agentflow.metrics.intervals import Rate, bootstrap_mean
from agentflow.metrics.machines import recorded_machine
from agentflow.metrics.tables import Column, Row, Table, percent
from agentflow.metrics.usage import summarize_usage
from agentflow.runs import read_calls, read_document
from agentflow.runs.events import read_typed_events
from agentflow.runs.reading import require_runs
from agentflow.runs.record import RunRecord

ABOUT = (
    "Mispredicted: share of the edits predicted to succeed that failed. Surface: share of the "
    "edits of failed machines that keep the moving types. Local: share of all such edits. "
    "Size: mean tree edit distance, in blocks. Error, bias: median size and median of predicted "
    "minus simulated score. Roles: share of the tokens of all replies. The rules are "
    "in docs/reference/behaviour.md."
)


@dataclass(frozen=True)
class Result:
    """A source and how its designers behave."""

    source: str
    runs: int
    found: Behaviour

    def to_json(self) -> dict[str, Any]:
        """The result as JSON data; what was never counted has `value` or `mean` None."""
        found = self.found
        return {
            "source": self.source,
            "runs": self.runs,
            "edits": found.local.of,
            "misprediction": _rate(found.mispredicted),
            "surface_level": _rate(found.surface),
            "local": _rate(found.local),
            "tree_edit_distance": {"mean": self._size, "interval": bootstrap_mean(found.sizes)},
            "prediction": {"count": len(found.errors), "error": found.error, "bias": found.bias},
            "effort": {"tokens": dict(found.effort), "shares": found.shares},
        }

    @property
    def _size(self) -> float | None:
        sizes = self.found.sizes
        return sum(sizes) / len(sizes) if sizes else None

    def row(self, roles: Sequence[str]) -> Row:
        """The result as a line of the table."""
        found, shares = self.found, self.found.shares
        numbers = (self._size, len(found.errors), found.error, found.bias)
        return Row(
            (self.source,),
            (
                found.local.of,
                *(f"{rate} ({percent(rate.value, 0)})" if rate.of else None
                  for rate in (found.mispredicted, found.surface, found.local)),
                *numbers,
                *(shares.get(role) for role in roles),
            ),
        )  # fmt: skip


def _rate(rate: Rate) -> dict[str, Any]:
    return {"count": rate.count, "of": rate.of, "value": rate.value, "interval": rate.interval}


def observe(paths: Iterable[Path]) -> list[Result]:
    """How the designers of each run, or of all runs below each folder, behave.

    Raises:
        RunError: A path holds no run, or a run is damaged.
    """
    found = []
    for path in paths:
        if not path.is_dir():
            raise RunError(f"no such directory: {path}")
        runs = require_runs(path)
        found.append(Result(str(path), len(runs), sum(map(behaviour_of, runs), Behaviour())))
    return found


def behaviour_of(run: Path) -> Behaviour:
    """How the designer of one run behaves."""
    document = read_document(run)
    task = RunPlan.of_run(run, document, usable_engine(engine_of_run(document))).task
    events, calls = list(read_typed_events(run)), list(read_calls(run))
    predictions = {call["request"]["label"]: prediction_in(call) for call in calls}
    spent = summarize_usage(calls).roles
    return behaviour(
        [*edits(RunRecord.of(events)), *agent_edits(events)],
        lambda place: predictions.get(str(place), ""),
        Machines(partial(recorded_machine, run)),
        {role: item.completion for role, item in spent.items()},
        metres=task.brief.greatest is None,
    )


def prediction_in(call: Mapping[str, Any]) -> str:
    """What the reply to a call predicts; nothing if its role is not installed."""
    role, text = call["request"]["role"], call["reply"]["text"]
    return ROLES[role].prediction(text) if role in ROLES else ""


class Machines:
    """Machines that are compared by their content hashes."""

    def __init__(self, read: Callable[[str], Machine]) -> None:
        """`read` gives the machine with a hash."""
        self._machine = cache(read)

    def keeps_mechanism(self, before: str, after: str) -> bool:
        return moving_types(self._machine(before)) == moving_types(self._machine(after))

    def size(self, before: str, after: str) -> float:
        return tree_edit_distance(self._machine(before), self._machine(after))


def moving_types(machine: Machine) -> frozenset[int]:
    """The types of blocks by which a machine works.

    They make force or motion, move against their parent, or let go or grip.
    """
    kinds = {step.type: library()[step.type] for step in machine.steps}
    return frozenset(
        type_
        for type_, kind in kinds.items()
        if kind.non_static or kind.joint.moves or kind.joint.switch == "decouplers"
        or kind.grip_direction
    )  # fmt: skip


def behaviour_columns(roles: Sequence[str], effort: str) -> tuple[Column, ...]:
    """The columns of `Result.row`; `effort` says what roles have shares of."""
    return (
        Column("", "edits"),
        *(Column("", name) for name in ("mispredicted", "surface", "local")),
        Column("", "size", digits=1),
        Column("predicted score", "n"),
        Column("predicted score", "error"),
        Column("predicted score", "bias"),
        *(Column(effort, role, percent=True, digits=0) for role in roles),
    )


def working_roles(results: Iterable[Result]) -> tuple[str, ...]:
    """The roles of several results, each once."""
    return tuple(dict.fromkeys(role for result in results for role in result.found.shares))


def results_table(results: Sequence[Result]) -> Table:
    """The results in lines."""
    roles = working_roles(results)
    columns = behaviour_columns(roles, "tokens")
    rows = tuple(result.row(roles) for result in results)
    return Table("Behaviour of designers", ("runs",), columns, rows, notes=(ABOUT,))

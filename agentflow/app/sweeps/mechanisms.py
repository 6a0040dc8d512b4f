"""Which mechanism classes the machines of a finished run belong to."""

from __future__ import annotations

from agentflow.app.design.results import read_finished
from agentflow.app.sweeps.tables import FinishedRun
from agentflow.env.archive import load_npz
from agentflow.env.mechanism import classify
from agentflow.machine import library, read_machine
from agentflow.metrics.niches import best_by_class
from agentflow.runs.events import NicheEvent


def classes_of(run: FinishedRun) -> dict[str, float]:
    """Mechanism class -> highest score of its machines.

    A run that kept an archive recorded the classes of all its machines. Of other runs, only the
    best machine is known, by its stored rollout; nothing if there is none, or if it is from before
    work was measured.
    """
    niches = [event for event in run.numbers.record.archives if isinstance(event, NicheEvent)]
    if niches:
        return {name: event.score or 0.0 for name, event in best_by_class(niches).items()}
    result = read_finished(run.path)
    machine = read_machine(result["machine"], library()).machine if result["valid"] else None
    file = run.path / "rollouts" / f"{'' if machine is None else machine.digest}.npz"
    if machine is None or not file.exists():
        return {}
    mechanism = classify(machine, load_npz(file))
    return {} if mechanism is None else {str(mechanism): result["score"]}

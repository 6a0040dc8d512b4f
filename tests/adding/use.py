"""Uses everything that was added to a copy of the package, and prints what came of it as JSON.

Run in an empty folder, with the copy and the repository on the path.
"""

from __future__ import annotations

import asyncio
import json
import sys
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from agentflow.integrations.blackbox import loss

import agentflow
from agentflow.agents.registry import stage_of
from agentflow.app.design.plan import RunPlan
from agentflow.app.sweeps.estimates import estimate
from agentflow.cli import main
from agentflow.config.run import DesignConfig
from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.families.movement import Movement
from agentflow.env.tasks.registry import get_level, get_task
from agentflow.machine import ROOT, Machine, Step, library, place
from agentflow.metrics.cells import METRICS
from agentflow.metrics.tables import Table
from agentflow.report.sweep import sweep_data
from agentflow.runs import read_calls, read_document
from agentflow.runs.events import JudgementEvent, read_typed_events
from agentflow.runs.locations import INITIAL
from agentflow.runs.record import RunRecord
from agentflow.tools.bench import Bench
from agentflow.tools.workspace import KnownMachines, StageBudget
from agentflow.training.grpo.config import AdvantageConfig
from agentflow.training.objectives.functions import read_test
from agentflow.training.objectives.measuring import Motion

DESIGN = ("design", "--task", "strolling", "--workflow", "judged", "--engine", "tick")
SET = ("prompts=loud", "trajectories=1", "verify=false")
SEARCH = ("search.strategy=eager", "search.rounds=1", "search.width=1", "search.request_rounds=1")


class Kites(Movement):
    """Movement with every block."""

    @property
    def brief(self) -> Any:
        return replace(super().brief, blocks=tuple(library()))


class OneTask:
    """The world of a bench where nothing is simulated."""

    def __init__(self) -> None:
        self.brief, self.notes = get_task("movement").brief, list[Any]()

    def save(self, machine: Machine) -> None:
        """Keep nothing."""

    def note(self, event: Any) -> None:
        """Keep the event."""
        self.notes.append(event)


def told(*arguments: str) -> str:
    """What a command prints."""
    with redirect_stdout(StringIO()) as out:
        assert main(list(arguments)) == 0, arguments
    return out.getvalue()


async def weigh(car: str) -> str:
    """What the new tool tells of a car."""
    bench = Bench(OneTask(), INITIAL, StageBudget(1, None, None, 0), KnownMachines())
    name = (await bench.call("check", {"machine": car})).data["machine"]
    return (await bench.call("weigh", {"machine": name})).text


def use(car: str) -> dict[str, Any]:
    """What came of each new part."""
    settings = [word for item in (*SET, *SEARCH) for word in ("--set", item)]
    result = json.loads(told(*DESIGN, *settings, "--quiet", "--json"))
    run = Path(result["run"])
    requests = [call["request"] for call in read_calls(run)]
    judged = next(request for request in requests if request["role"] == "judge")
    events = list(read_typed_events(run))
    told("report", str(run), "--page", "plain", "--out", "plain.html")

    kite = Machine((ROOT, Step(1, 24, 0, 4)))
    task = Kites(**vars(get_task("movement")))
    assembly = assemble(kite, place(kite), constants())
    flight = simulate(kite, task)
    assert flight.trace is not None
    motion = Motion(kite, flight, flight.trace, 5.0)
    rests = read_test("rests", {"metres": 5})
    ((_, rested),) = rests.measure(motion)
    plan = RunPlan.of(DesignConfig(task="strolling", workflow="judged"))
    return {
        "Task family": [result["task"], get_level("strolling").file.title],
        "Block type": [library()[24].name, told("blocks", "24").splitlines()[0]],
        "Block behaviour": [
            [device.loss for device in assembly.devices.moved],
            flight.status,
            float(flight.trace.position[-1, 0, 0]),
        ],
        "Role": [stage_of("judge"), estimate(plan).calls],
        "Prompt set": judged["messages"][0]["text"],
        "Search strategy": read_document(run)["config"]["settings"]["search"]["strategy"],
        "Workflow": result["workflow"],
        "Tool": asyncio.run(weigh(car)),
        "Function test": [rests.phrase(), rested.passed],
        "Physics engine": result["engine"],
        "Metric": METRICS["run_count"].about,
        "Advantage": AdvantageConfig(name="middle").chosen(np.array([1.0, 2.0, 9.0])).tolist(),
        "Page": "A score" in Path("plain.html").read_text(encoding="utf-8"),
        "Chart": sweep_data("", "", {}, [Table("", (), (), ())], [{}, {}])["many"],
        "Kind of event": [
            [event.text for event in events if isinstance(event, JudgementEvent)],
            RunRecord.of(events).remarks,
        ],
        "Command": told("size", str(run)),
        "Adapter": loss(car),
        "Model client": agentflow.design(
            "movement",
            workflow="single",
            answer=lambda _: f"A car.\n```json\n{car}\n```",
            model="a car",
            settings={"trajectories": 1, "search.rounds": 0, "verify": False},
        ).model,
    }


if __name__ == "__main__":
    print(json.dumps(use(Path(sys.argv[1]).read_text(encoding="utf-8"))))

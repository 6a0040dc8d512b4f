"""A small task, an author that answers every role from the prompt, and a fast evaluator."""

from __future__ import annotations

import asyncio
import json
import random
import re
from collections.abc import Callable, Sequence
from typing import Any

from agentflow.agents.base import AskContext
from agentflow.agents.replies import machine_items
from agentflow.llm.messages import Client, Reply, Request, ToolCall, Usage
from agentflow.llm.procedural.reading import read_listing
from agentflow.llm.wrappers.budget import Budget, BudgetClient, BudgetSettings
from agentflow.machine.brief import Brief
from agentflow.machine.formats.coordinates import read_coordinates
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.tree import Machine
from agentflow.prompts.render import PromptSet
from agentflow.runs.events import RunEvent
from agentflow.search.elites.axes import Axis, Measurement
from agentflow.search.node import Evaluation
from agentflow.tools.host import Aims, Shot, SimulationSummary, Told
from agentflow.workflows.base import WorkflowResult
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.settings import WorkflowSettings
from tests.scripted import ScriptedClient

BRIEF = Brief(
    name="movement",
    objective="Drive as far as possible along z+.",
    scene=("The ground is flat.",),
    schedule=("At t = 0 s wheels start to turn.",),
    score=("Score: metres along z+.",),
    blocks=(0, 1, 2),
    required={2: 1},
)
PROMPTS = PromptSet()
ROOT = {"type": 0, "id": 0, "parent": -1, "face_id": -1}
BLUEPRINT = {
    "definition": "A cart.",
    "function_points": ["carry", "roll"],
    "design_structure": [
        {"function_name": "Body", "description": "d", "related_function_points": ["carry"]},
        {"function_name": "Drive", "description": "d", "related_function_points": ["roll"]},
    ],
    "build_order": ["Body", "Drive"],
    "machine_structure": {
        "Body": {"type": [1], "guidance": "one block"},
        "Drive": {"type": [2], "guidance": "one wheel"},
    },
}
CRITIQUE = (
    "<Three-Dimensional Perception of the World>z+: forward</Three-Dimensional Perception of the "
    "World><Question Answer>It looks lame.</Question Answer>"
    "<Summary of Design Defects>- blocks 1 | structure Body | too small"
    "</Summary of Design Defects>"
)
INQUIRY = (
    "<Thought Process>see</Thought Process><Required Feedback>"
    '[{"id": 0, "duration": [0, 1], "properties": ["position"]}]</Required Feedback>'
)
NOTHING = "I cannot think of anything."


def steps(*blocks: tuple[int, int, int]) -> list[dict[str, int]]:
    """The root and blocks of (type, parent, face)."""
    return [
        ROOT,
        *(
            {"type": kind, "id": i, "parent": parent, "face_id": face}
            for i, (kind, parent, face) in enumerate(blocks, start=1)
        ),
    ]


def machine(*blocks: tuple[int, int, int]) -> Machine:
    """The same as a machine."""
    read = read_machine(steps(*blocks)).machine
    assert read is not None
    return read


def fenced(data: object) -> str:
    return f"Because.\n```json\n{json.dumps(data)}\n```"


def edit(script: str) -> str:
    return (
        "<Thought Process>t</Thought Process><Modification Description>d"
        "</Modification Description><Simulation Prediction After Modification>p"
        f"</Simulation Prediction After Modification><Modification Steps>\n{script}\n"
        "</Modification Steps>"
    )


class Author:
    """Answers from the prompt and by chance, which depends on the label alone."""

    def __init__(self, seed: int = 0, refused: float = 0.3) -> None:
        self.seed, self.refused = seed, refused

    def __call__(self, request: Request) -> Reply:
        chance = random.Random(f"{self.seed}/{request.label}")
        text = NOTHING
        if request.tools:
            return self.agent(request, chance)
        if chance.random() >= self.refused:
            text = getattr(self, request.role)(request.messages[1].text, chance)
        return Reply(text=text, usage=Usage(prompt=100, completion=10), model="author")

    def agent(self, request: Request, chance: random.Random) -> Reply:
        """Check a machine, simulate it where that is possible, submit it, and so on."""
        last = request.messages[-1].text
        named = re.match(r"Machine (\w{8})(?: is|:) (\w+)", last)
        arguments: dict[str, object] = {"machine": named[1] if named else ""}
        if named is None or named[2] == "submission" or chance.random() < self.refused:
            tool, arguments = "check", {"machine": json.dumps(self._tried(chance))}
        elif named[2] == "valid" and "simulate" in {tool.name for tool in request.tools}:
            tool = "simulate"
        else:
            tool = "submit"
        call = ToolCall(id="a", name=tool, arguments=json.dumps(arguments))
        usage = Usage(prompt=100, completion=10)
        return Reply(text="", finish="tool_calls", usage=usage, model="author", tool_calls=(call,))

    def _tried(self, chance: random.Random) -> list[dict[str, int]]:
        """A cart with one to three blocks, some of which may overlap."""
        blocks = [(1, parent, chance.randrange(6)) for parent in range(chance.randrange(1, 4))]
        return steps(*blocks, (2, 0, chance.randrange(6)))

    def meta_designer(self, _prompt: str, _chance: random.Random) -> str:
        return fenced(BLUEPRINT)

    def designer(self, prompt: str, chance: random.Random) -> str:
        return fenced(_written(self._designed(prompt, chance), prompt))

    drafter = designer

    def _designed(self, prompt: str, chance: random.Random) -> list[dict[str, int]]:
        built = _current(prompt)
        if "Name: Drive" not in prompt:
            built = steps((1, 0, chance.randrange(2)))
        if "Name: Body" not in prompt:
            built += [_step(len(built), 2, 0, chance.randrange(2, 4))]
        return built

    def inspector(self, _prompt: str, _chance: random.Random) -> str:
        return CRITIQUE

    def analyst(self, prompt: str, _chance: random.Random) -> str:
        edits = prompt.partition("## What edits did\n")[2].partition("\n\n")[0].splitlines()
        return f"<Lessons>\nOf {len(edits) - 1} edits: {edits[1]}\n</Lessons>"

    def querier(self, _prompt: str, _chance: random.Random) -> str:
        return INQUIRY

    def refiner(self, prompt: str, chance: random.Random) -> str:
        built = _current(prompt)
        parent = chance.choice([s["id"] for s in built if s["type"] != 2])
        face = chance.randrange(6)
        if "contains the whole modified machine" in prompt:
            whole = [*built, _step(len(built), 1, parent, face)]
            return edit(fenced(_written(whole, prompt)))
        return edit(f"Add 1 to {parent} in {face}")


class Script:
    """Answers by label; a label it does not know is an error."""

    def __init__(self, replies: dict[str, str]) -> None:
        self.replies = replies

    def __call__(self, request: Request) -> Reply:
        usage = Usage(prompt=100, completion=10)
        return Reply(text=self.replies[request.label], usage=usage, model="script")


class Delayed:
    """A client that takes its time, by chance."""

    def __init__(self, inner: Client, chance: random.Random) -> None:
        self.inner, self.chance = inner, chance

    @property
    def name(self) -> str:
        return self.inner.name

    async def complete(self, request: Request) -> Reply:
        await asyncio.sleep(self.chance.random() * 2e-3)
        return await self.inner.complete(request)

    async def aclose(self) -> None:
        await self.inner.aclose()


def by_digest(found: Machine) -> float:
    """A score that looks like chance and is not."""
    return int(found.digest[:4], 16) / 1000


BLOCKS = Axis("blocks", "", 0.5, 12.5, 6)
"""What kind of machine one of the shelf is."""


class Shelf:
    """An evaluator that looks scores up instead of simulating."""

    def __init__(
        self,
        score: Callable[[Machine], float | None] = by_digest,
        delays: random.Random | None = None,
    ) -> None:
        self.score, self.delays = score, delays
        self.tried: list[str] = []

    async def evaluate(self, found: Machine, label: str) -> Evaluation:
        assert label == f"machine-{found.digest}"
        self.tried.append(found.digest)
        if self.delays is not None:
            await asyncio.sleep(self.delays.random() * 2e-3)
        score = self.score(found)
        status = "timeout" if score is None else "ok"
        told = f"Rolled {score} m."
        summary = SimulationSummary(score, status, told, ((1, 0, 0.5),), found.digest)
        kind = Measurement(BLOCKS, float(len(found)))
        return Evaluation(True, score, summary, measurements=(kind,))

    @property
    def aims(self) -> Aims:
        return Aims(good=3.0)

    def count_changes(self, found: Machine) -> int:
        return len(found)

    async def verified(self, found: Machine) -> Told:
        score = self.score(found)
        return Told(f"verified score {score}", {"score": score})

    async def feedback(self, found: Machine, trial: int) -> Told:
        assert found.digest in self.tried
        return Told(f"Rolled {self.score(found)} m.", {"trial": trial})

    async def query(self, found: Machine, queries: Sequence[object]) -> Told:
        assert found.digest in self.tried
        return Told(f"{len(queries)} tables.", [])

    async def views(self, found: Machine) -> tuple[str, ...]:
        return (f"data:image/png;base64,{found.digest}",)

    async def look(self, found: Machine, shot: Shot) -> bytes:
        return f"{found.digest} {shot}".encode()


class Notes:
    """A record in memory; events must be unique and plain JSON data."""

    def __init__(self) -> None:
        self.events: dict[tuple[str, str], dict[str, Any]] = {}
        self.machines: dict[str, str] = {}

    def event(self, event: RunEvent) -> None:
        key, data = (event.kind, event.label), event.data
        assert key not in self.events, key
        assert json.loads(json.dumps(data)) == data
        self.events[key] = data

    def save_machine(self, digest: str, text: str) -> None:
        assert self.machines.setdefault(digest, text) == text

    def of(self, kind: str) -> dict[str, dict[str, Any]]:
        return {label: data for (k, label), data in self.events.items() if k == kind}


class Run:
    """One run of a workflow, and everything that can be looked at afterwards.

    Its strategy is `mcts`, with the stages of the paper, unless the settings name another.
    """

    def __init__(
        self,
        replies: Callable[[Request], Reply],
        settings: dict[str, Any] | None = None,
        *,
        shelf: Shelf | None = None,
        budget: int | None = None,
        delays: random.Random | None = None,
        client: Client | None = None,
        max_retry: int = 3,
        seed: int = 0,
        brief: Brief = BRIEF,
    ) -> None:
        self.brief = brief
        self.client = ScriptedClient(replies)
        self.shelf = shelf or Shelf()
        self.notes = Notes()
        search = {"strategy": "mcts", **(settings or {}).get("search", {})}
        self.settings = WorkflowSettings.model_validate({**(settings or {}), "search": search})
        self.max_retry, self.seed, self.budget = max_retry, seed, budget
        self.model_roles: list[str] = []
        outer = client or self.client if delays is None else Delayed(self.client, delays)
        self._client = BudgetClient(outer, Budget(BudgetSettings(calls=budget)))

    async def __call__(self, name: str = "hierarchical") -> WorkflowResult:
        return await WORKFLOWS[name](
            self.brief,
            self.context,
            self.shelf,
            self.settings,
            self.notes,
            self.seed,
            self.budget,
        )

    def context(self, role: str) -> AskContext:
        self.model_roles.append(role)
        return AskContext(self._client, PROMPTS, max_retry=self.max_retry)

    @property
    def labels(self) -> list[str]:
        return [request.label for request in self.client.requests]

    def prompt(self, label: str) -> str:
        (found,) = [r.messages[1].text for r in self.client.requests if r.label == label]
        return found


def _step(number: int, kind: int, parent: int, face: int) -> dict[str, int]:
    return {"type": kind, "id": number, "parent": parent, "face_id": face}


def machine_in(prompt: str) -> Machine:
    """The current machine of a prompt."""
    read = read_machine(_current(prompt)).machine
    assert read is not None
    return read


def _current(prompt: str) -> list[dict[str, int]]:
    section = prompt.partition("## Current machine\n")[2].partition("\n## ")[0]
    if (listed := read_listing(section)) is not None:
        return listed.to_json()
    found = re.search(r"```json\n(.*?)```", section, re.DOTALL)
    if found and '"Position"' in found[1]:
        read = read_coordinates(found[1], BRIEF.blocks).machine
        assert read is not None
        return read.to_json()
    return json.loads(found[1]) if found else []


def _written(steps: list[dict[str, int]], prompt: str) -> object:
    """A tree as the prompt wants it; one that cannot be placed as it is."""
    read = read_machine(steps).machine
    if '"Position"' not in prompt.partition("## Your reply")[2] or read is None:
        return steps
    return machine_items(read, "coordinates")

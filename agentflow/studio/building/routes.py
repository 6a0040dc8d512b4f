"""Where the page asks about a machine that is being built. The page keeps the machine itself."""

from __future__ import annotations

import asyncio
from typing import Any

from starlette.routing import BaseRoute

from agentflow.app.design.plan import task_of_run
from agentflow.app.inspect.reading import recorded_machine
from agentflow.app.machines.files import list_blocks, read_one
from agentflow.app.pages.films import Shapes
from agentflow.app.pages.runs import FINE, ReportedMachine, film_machine
from agentflow.errors import UsageError
from agentflow.machine import Machine
from agentflow.runs import read_document
from agentflow.studio.answers import Nothing, get, post
from agentflow.studio.building import changes
from agentflow.studio.building.requests import (
    Asked,
    Built,
    Edited,
    OnTask,
    Opened,
    Recorded,
    read_for_task,
)
from agentflow.studio.building.rules import Rules
from agentflow.studio.building.state import describe_state, spots_json
from agentflow.studio.building.workshop import Workshop
from agentflow.studio.folder import RunFolder
from agentflow.studio.simulations import Simulations

SEED = 0
"""Of all tests."""


class Building:
    """Answers about machines that are being built."""

    def __init__(self, folder: RunFolder, workshop: Workshop, simulations: Simulations) -> None:
        """Prepare; nothing is simulated yet."""
        self._folder, self._workshop, self._simulations = folder, workshop, simulations

    @property
    def routes(self) -> list[BaseRoute]:
        """Where the page asks."""
        return [
            get("/api/build/blocks", Nothing, self.blocks),
            get("/api/build/new", OnTask, self.new),
            get("/api/build/from", Recorded, self.recorded),
            post("/api/build/state", Built, self.state),
            post("/api/build/spots", Asked, self.spots),
            post("/api/build/edit", Edited, self.edit),
            post("/api/build/open", Opened, self.open),
            post("/api/build/test", Built, self.test),
            post("/api/build/film", Built, self.film),
            post("/api/build/finish", OnTask, self.finish),
        ]

    async def blocks(self, _given: Nothing) -> list[dict[str, Any]]:
        """The block library."""
        return list_blocks()

    async def new(self, given: OnTask) -> dict[str, Any]:
        """What every machine of a task begins with, and the task in words."""
        brief = given.level.brief
        return {
            **describe_state(brief.given, brief),
            "allowed": list(brief.blocks),
            "objective": brief.objective,
            "score": list(brief.score),
            "scene": [*brief.scene, *brief.schedule],
        }

    async def recorded(self, given: Recorded) -> dict[str, Any]:
        """A machine of a run, and the task that it was made for."""
        path = self._folder.run(given.run)
        digest = given.machine
        machine = read_one(str(path)) if digest is None else recorded_machine(path, digest)
        return {"task": task_of_run(path, read_document(path)).name, "machine": machine.to_json()}

    async def state(self, given: Built) -> dict[str, Any]:
        """Everything about a machine."""
        machine, rules = given.read()
        return await asyncio.to_thread(describe_state, machine, rules.brief)

    async def spots(self, given: Asked) -> list[dict[str, Any]]:
        """The faces where a block could go, and why it cannot go there."""
        machine, rules = given.read()
        return await asyncio.to_thread(_find_spots, machine, rules, given)

    async def edit(self, given: Edited) -> dict[str, Any]:
        """The changed machine, or why it cannot be changed like this."""
        machine, rules = given.read()
        changed, chosen = rules.make(_change(machine, rules, given))
        return await asyncio.to_thread(describe_state, changed, rules.brief, chosen)

    async def open(self, given: Opened) -> dict[str, Any]:
        """A machine from a file in any format."""
        machine = read_for_task(given.level, given.text, is_bsg=given.name.lower().endswith(".bsg"))
        return await asyncio.to_thread(describe_state, machine, given.level.brief)

    async def test(self, given: Built) -> dict[str, Any]:
        """Simulate a machine, and record it."""
        return await self._workshop.test(given.task, given.read()[0])

    async def film(self, given: Built) -> dict[str, Any]:
        """The film of a machine."""
        machine, shapes = given.read()[0], Shapes()
        item = ReportedMachine(machine, given.level, SEED, None, FINE, None, "")
        data = await film_machine(item, shapes, await self._simulations.pool(), lambda: None)
        return {"machine": data, "shapes": shapes.rows, "files": shapes.files}

    async def finish(self, given: OnTask) -> dict[str, Any]:
        """Complete the run of a task."""
        return await self._workshop.finish(given.task)


def _find_spots(machine: Machine, rules: Rules, given: Asked) -> list[dict[str, Any]]:
    first = None if given.first is None else _end(machine, given.first)
    if given.add is not None:
        return spots_json(machine, rules.spots_to_add(given.add, first))
    if given.move is not None:
        return spots_json(machine, rules.spots_to_move(_block(machine, given.move)))
    if given.copy_of is not None:
        return spots_json(machine, rules.spots_to_copy(_block(machine, given.copy_of)))
    raise UsageError("expected `add`, `move` or `copy_of`")


def _change(machine: Machine, rules: Rules, given: Edited) -> changes.Change:
    block, ends = _block(machine, given.block), [_end(machine, end) for end in given.ends]
    if len(ends) < {"add": 1, "move": 1, "copy": 1}.get(given.do, 0):
        raise UsageError(f"{given.do} needs a face: give `ends` as [[block, face]]")
    if given.do == "add":
        return changes.add(machine, given.type, ends)
    if given.do == "move":
        return changes.move(machine, block, ends[0])
    if given.do == "copy":
        return changes.copy(machine, block, ends[0])
    if given.do == "mirror":
        return changes.mirror(machine, block)
    return rules.turned(block) if given.do == "turn" else changes.remove(machine, block)


def _block(machine: Machine, block: int) -> int:
    if not 0 <= block < len(machine):
        raise UsageError(f"there is no block {block}; the blocks are 0 to {len(machine) - 1}")
    return block


def _end(machine: Machine, end: list[int]) -> changes.End:
    if len(end) != 2:
        raise UsageError("an end is [block, face]")
    return _block(machine, end[0]), end[1]

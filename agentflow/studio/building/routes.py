"""Where the page asks about a machine that is being built. The page keeps the machine itself."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any, Literal

from pydantic import Field
from starlette.responses import Response
from starlette.routing import BaseRoute

from agentflow.app.design.plan import task_of_run
from agentflow.app.machines.convert import made_file
from agentflow.app.machines.files import read_one
from agentflow.app.pages.blocks import block_card
from agentflow.app.pages.films import solid_row
from agentflow.app.pages.runs import FINE, ReportedMachine, task_wording
from agentflow.app.tasks import find_task, task_info
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.records import record_machine, record_of
from agentflow.env.tasks.registry import task_names
from agentflow.errors import UnknownNameError, UsageError
from agentflow.machine import Machine, check
from agentflow.machine.blocks.library import STARTING_BLOCK
from agentflow.machine.edits import changes
from agentflow.machine.edits.changes import Change, Mending
from agentflow.machine.edits.draft import End
from agentflow.machine.formats.detect import read_for
from agentflow.metrics.machines import recorded_machine
from agentflow.runs import read_document
from agentflow.studio.answers import Arguments, Hash, Name, OneRun, get, post
from agentflow.studio.building.control import control_parts, controlled
from agentflow.studio.building.person_runs import PersonRuns
from agentflow.studio.building.state import describe_block, describe_state, find_spots, spots_to_add
from agentflow.studio.folder import RunFolder
from agentflow.studio.simulations import Simulations
from agentflow.study.session import Written

SEED = 0
"""Of all tests."""


class OnTask(Arguments):
    """A task by name."""

    task: str = Field(max_length=80)

    @property
    def level(self) -> Task:
        """The task.

        Raises:
            UnknownNameError: It is not a known level.
        """
        if self.task not in task_names():
            raise UnknownNameError("task", self.task, task_names())
        return find_task(self.task)


class MachineForTask(OnTask):
    """A machine for a task."""

    machine: Written

    def read(self) -> tuple[Machine, Mending]:
        """The machine, and the rules for changing it.

        Raises:
            UsageError: It is not file-valid.
        """
        machine = _read_for_task(self.level, self.machine)
        return machine, Mending(machine, self.level.brief)


class Asked(MachineForTask):
    """What to find faces for: a new block, or one to move or copy."""

    add: int | None = None
    first: list[int] | None = Field(None, min_length=2, max_length=2)
    """The first end of a two-ended block."""
    move: int | None = None
    copy_of: int | None = None


class AtFace(Asked):
    """A block at a face where it may not fit."""

    end: list[int] = Field(min_length=2, max_length=2)


class Controlled(MachineForTask):
    """What is to control the machine, as in a machine file: `controls` and `controllers`."""

    text: str = Field(max_length=100_000)


class Made(MachineForTask):
    """A file for those who make the machine."""

    suffix: Literal[".html", ".step", ".3mf"]


class Edited(MachineForTask):
    """A change."""

    do: Literal["add", "remove", "move", "turn", "copy", "mirror", "fix"]
    block: int = Field(0, ge=0)
    type: int = 0
    ends: list[list[int]] = Field([], max_length=2)


class Tested(MachineForTask):
    """A machine to test."""

    run: Name = ""
    """The run of earlier tests; "" begins another one."""


class Opened(OnTask):
    """The text of a machine file."""

    text: str = Field(max_length=4_000_000)
    name: Name = ""


class Recorded(OneRun):
    """A machine of a run; without a hash, its best one."""

    machine: Hash | None = None


class Building:
    """Answers about machines that are being built."""

    def __init__(
        self, folder: RunFolder, person_runs: PersonRuns, simulations: Simulations
    ) -> None:
        """Prepare; nothing is simulated yet."""
        self._folder, self._person_runs, self._simulations = folder, person_runs, simulations

    @property
    def routes(self) -> list[BaseRoute]:
        """Where the page asks."""
        return [
            get("/api/build/blocks", OnTask, self.blocks),
            get("/api/build/new", OnTask, self.new),
            get("/api/build/from", Recorded, self.recorded),
            get("/api/build/record", OnTask, self.record),
            post("/api/build/state", MachineForTask, self.state),
            post("/api/build/spots", Asked, self.spots),
            post("/api/build/ghost", AtFace, self.ghost),
            post("/api/build/edit", Edited, self.edit),
            post("/api/build/open", Opened, self.open),
            post("/api/build/control", Controlled, self.control),
            post("/api/build/made", Made, self.made),
            post("/api/build/test", Tested, self.test),
            post("/api/build/film", MachineForTask, self.film),
            post("/api/build/finish", OneRun, self.finish),
        ]

    async def blocks(self, given: OnTask) -> list[dict[str, Any]]:
        """The blocks that may be added at a task, with the number that it requires, if any."""
        brief = given.level.brief
        kinds = [kind for kind in brief.blocks if kind != STARTING_BLOCK]
        cards = await asyncio.to_thread(lambda: [block_card(kind) for kind in kinds])
        return [{**card, "required": brief.required.get(card["type"])} for card in cards]

    async def new(self, given: OnTask) -> dict[str, Any]:
        """What every machine of a task begins with, and the task in words."""
        level, info = given.level, task_info(given.task, {})
        brief, scene = level.brief, level.scene()
        return {
            **describe_state(brief.given, level),
            "title": info.title,
            **task_wording(brief),
            **control_parts(brief),
            "unit": level.unit,
            "good": info.good,
            "record": info.record,
            "level": [solid_row(item) for item in scene.objects],
            "start": {"height": scene.start.height, "rotation": scene.start.rotation},
        }

    async def recorded(self, given: Recorded) -> dict[str, Any]:
        """A machine of a run, and the task that it was made for."""
        path = self._folder.run(given.run)
        known = given.machine
        machine = recorded_machine(path, known) if known else read_one(str(path))
        return {"task": task_of_run(path, read_document(path)).name, "machine": machine.to_json()}

    async def record(self, given: OnTask) -> dict[str, Any]:
        """The machine of a task's record.

        Raises:
            UsageError: There is none, or the repository is not at hand.
        """
        found = record_of(given.level)
        machine = record_machine(found.name) if found else None
        if machine is None:
            raise UsageError(f"the machine of the record of {given.task} is not at hand")
        return {"task": given.task, "machine": machine.to_json()}

    async def state(self, given: MachineForTask) -> dict[str, Any]:
        """Everything about a machine."""
        return await asyncio.to_thread(describe_state, given.read()[0], given.level)

    async def spots(self, given: Asked) -> list[dict[str, Any]]:
        """The faces where a block could go, and why it cannot go there."""
        machine, rules = given.read()
        return await asyncio.to_thread(_find_spots, machine, rules, given)

    async def ghost(self, given: AtFace) -> dict[str, Any]:
        """A block where it would be at a face, whether it fits or not."""
        machine, rules = given.read()
        ends = [_end(machine, end) for end in (given.first, given.end) if end is not None]
        held = given.move if given.move is not None else given.copy_of
        kind = given.add if held is None else machine[_block(machine, held)].type
        if kind is None:
            raise UsageError("expected `add`, `move` or `copy_of`")
        return await asyncio.to_thread(describe_block, machine, rules.brief, kind, ends)

    async def edit(self, given: Edited) -> dict[str, Any]:
        """The changed machine, or why it cannot be changed like this."""
        machine, rules = given.read()
        changed, chosen = await asyncio.to_thread(_changed, machine, rules, given)
        return await asyncio.to_thread(describe_state, changed, given.level, chosen)

    async def open(self, given: Opened) -> dict[str, Any]:
        """A machine from a file in any format."""
        is_bsg = given.name.lower().endswith(".bsg")
        machine = _read_for_task(given.level, given.text, is_bsg=is_bsg)
        return await asyncio.to_thread(describe_state, machine, given.level)

    async def control(self, given: Controlled) -> dict[str, Any]:
        """The machine with other controls, or everything that is wrong with them."""
        machine, rules = given.read()
        changed = controlled(machine, given.text, rules.brief)
        if not isinstance(changed, Machine):
            return {"problems": changed}
        return {"state": await asyncio.to_thread(describe_state, changed, given.level)}

    async def made(self, given: Made) -> Response:
        """Instructions, or a file for CAD programs or printers."""
        content = await asyncio.to_thread(made_file, given.read()[0], given.suffix)
        return Response(content, media_type="application/octet-stream")

    async def test(self, given: Tested) -> dict[str, Any]:
        """Simulate a machine, and record it."""
        return await self._person_runs.test(given.task, given.read()[0], given.run)

    async def film(self, given: MachineForTask) -> dict[str, Any]:
        """The film of a machine."""
        item = ReportedMachine(given.read()[0], given.level, SEED, None, FINE)
        return await self._simulations.film(item)

    async def finish(self, given: OneRun) -> dict[str, Any]:
        """Complete a run of tests."""
        return await self._person_runs.finish(given.run)


def _read_for_task(task: Task, source: object, *, is_bsg: bool = False) -> Machine:
    """The machine in what the page sent; UsageError if it is not file-valid."""
    report = check(read_for(task.brief, source, "bsg" if is_bsg else "auto"), task.brief)
    if report.machine is None:
        raise UsageError(report.problems[0].message)
    return report.machine


def _find_spots(machine: Machine, rules: Mending, given: Asked) -> list[dict[str, Any]]:
    first = None if given.first is None else _end(machine, given.first)
    if given.add is not None:
        return list(spots_to_add(rules, given.add, first))
    held = given.copy_of if given.move is None else given.move
    if held is None:
        raise UsageError("expected `add`, `move` or `copy_of`")
    change = changes.copy if given.move is None else changes.move
    made = partial(change, block=_block(machine, held))
    return list(find_spots(rules, lambda end: partial(made, to=end)))


def _changed(machine: Machine, rules: Mending, given: Edited) -> tuple[Machine, int]:
    block, ends = _block(machine, given.block), [_end(machine, end) for end in given.ends]
    if given.do in ("turn", "fix"):
        return rules.turn(block) if given.do == "turn" else rules.fix(block)
    if not ends and given.do in ("add", "move", "copy"):
        raise UsageError(f"{given.do} needs a face: give `ends` as [[block, face]]")
    made: dict[str, Change] = {
        "add": lambda draft: changes.add(draft, given.type, ends),
        "move": lambda draft: changes.move(draft, block, ends[0]),
        "copy": lambda draft: changes.copy(draft, block, ends[0]),
        "mirror": lambda draft: changes.mirror(draft, block),
        "remove": lambda draft: changes.remove(draft, block),
    }
    return rules.make(made[given.do])


def _block(machine: Machine, block: int) -> int:
    if not 0 <= block < len(machine):
        raise UsageError(f"there is no block {block}; the blocks are 0 to {len(machine) - 1}")
    return block


def _end(machine: Machine, end: list[int]) -> End:
    if len(end) != 2:
        raise UsageError("an end is [block, face]")
    return _block(machine, end[0]), end[1]

"""What the page shows of runs: their list, their record, their machines."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Mapping
from functools import lru_cache
from typing import Any, Literal

from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import BaseRoute, Route

from agentflow.app.benchmark.card import Scorecard
from agentflow.app.benchmark.page import leaderboard_data
from agentflow.app.design.config import load_config
from agentflow.app.design.plan import task_of_run
from agentflow.app.doctor import check_endpoint
from agentflow.app.pages.compare import Comparison
from agentflow.app.pages.runs import FINE, ReportedMachine, run_data
from agentflow.app.pages.tasks import LARGE, SMALL, level_data, level_picture
from agentflow.app.sweeps.estimates import estimate
from agentflow.app.tasks import list_tasks
from agentflow.config.run import KEY_VARIABLE
from agentflow.env.drawing.stills import png
from agentflow.errors import AgentflowError, UsageError
from agentflow.machine import Machine
from agentflow.metrics.machines import recorded_machine
from agentflow.runs import read_document
from agentflow.runs.reading import RESULT
from agentflow.studio.answers import Arguments, Hash, Name, Nothing, OneRun, get, post
from agentflow.studio.building.person_runs import PERSON
from agentflow.studio.building.routes import OnTask
from agentflow.studio.folder import RunFolder
from agentflow.studio.guard import FOLLOW, Refusal, told
from agentflow.studio.simulations import Simulations
from agentflow.studio.watching.designs import (
    Designs,
    NewDesign,
    for_page,
    require_possible,
    workflows_of_families,
)
from agentflow.studio.watching.listing import (
    BY_HAND,
    Listing,
    News,
    as_stream,
    follow_list,
    follow_run,
    usual_seconds,
)

SIZES = {"line": (112, 84), "card": (400, 300)}
"""Width and height of pictures, in pixels: in the lines of a list, and on cards."""


@lru_cache(maxsize=2000)
def _small_picture(machine: Machine, size: tuple[int, int]) -> bytes:
    return png(machine, view="three-quarter", size=size)


class OneMachine(OneRun):
    """A machine of a run by content hash."""

    machine: Hash


class OnePicture(OneMachine):
    """A machine, and where its picture is shown."""

    on: Literal["line", "card"] = "card"


class LevelPicture(OnTask):
    """A level, and where its picture is shown."""

    on: Literal["card", "page"] = "card"


class OneSweep(Arguments):
    """A sweep by name."""

    sweep: Name


class TwoRuns(Arguments):
    """Two runs by name."""

    a: Name
    b: Name


class Watching:
    """Answers about the runs of a folder."""

    def __init__(self, folder: RunFolder, designs: Designs, simulations: Simulations) -> None:
        """Prepare; nothing is read yet."""
        self._folder, self._designs, self._simulations = folder, designs, simulations
        self._listing = Listing(folder, designs)
        self._boards: tuple[list[list[Scorecard]], list[dict[str, Any]]] = [], []

    @property
    def routes(self) -> list[BaseRoute]:
        """Where the page asks."""
        return [
            get("/api/start", Nothing, self.start),
            get("/api/runs", Nothing, self.runs),
            get("/api/run", OneRun, self.run),
            get("/api/machine", OneMachine, self.machine),
            get("/api/pair", TwoRuns, self.pair),
            get("/api/designs", Nothing, self.designs),
            get("/api/designs/again", OneRun, self.again),
            post("/api/designs", NewDesign, self.begin_design),
            post("/api/designs/estimate", NewDesign, self.estimate),
            post("/api/designs/connect", NewDesign, self.connect),
            post("/api/designs/stop", OneRun, self.stop_design),
            post("/api/designs/resume", OneRun, self.resume_design),
            get("/api/picture", OnePicture, self.picture),
            get("/api/level", OnTask, self.level),
            get("/api/level/picture", LevelPicture, self.level_picture),
            get("/api/sweep", OneSweep, self.sweep),
            get("/api/leaderboards", Nothing, self.leaderboards),
            Route(FOLLOW, self.follow, methods=["GET"]),
        ]

    async def start(self, _given: Nothing) -> Mapping[str, Any]:
        """What forms offer: tasks, workflows and the default model; never a key."""
        return {
            "tasks": await asyncio.to_thread(list_tasks),
            "workflows": await asyncio.to_thread(workflows_of_families),
            "model": load_config(None, (), {}).model.name,
            "key_variable": KEY_VARIABLE,
            "runs": str(self._folder.root),
        }

    async def runs(self, _given: Nothing) -> list[dict[str, Any]]:
        """The list of runs."""
        return await asyncio.to_thread(self._listing.rows)

    async def run(self, given: OneRun) -> dict[str, Any]:
        """The data of a run's page, without machines."""
        path = self._folder.run(given.run)
        ended = (path / RESULT).exists()  # first: else the data may be older
        _, data = await asyncio.to_thread(run_data, path)
        if data["run"]["author"] == PERSON:
            data["run"]["workflow"], data["tools"] = BY_HAND, []
            data["run"]["sentence"] = data["run"]["sentence"].partition(": the run is ")[0]
            data["facts"] = [fact for fact in data["facts"] if fact[0] != "Resume"]
        return {**data, "name": given.run, "ended": ended}

    async def machine(self, given: OneMachine) -> dict[str, Any]:
        """A machine with its film: the shapes and files that it uses are in the answer."""
        path = self._folder.run(given.run)
        machine = recorded_machine(path, given.machine)
        item = ReportedMachine.of(path, read_document(path), machine, None, FINE)
        return await self._simulations.film(item)

    async def pair(self, given: TwoRuns) -> dict[str, Any]:
        """The best machines of two runs, with both films and what differs."""
        paths = [self._folder.run(name) for name in (given.a, given.b)]
        one, other = (task_of_run(path, read_document(path)).name for path in paths)
        if one != other:
            raise UsageError(
                f"{given.a} is a run of {one} and {given.b} of {other}: only runs of one task can "
                "be compared; choose another pair"
            )
        comparison = await asyncio.to_thread(Comparison.of, (str(paths[0]), str(paths[1])))
        played = await comparison.play(await self._simulations.pool())
        data = comparison.page_data(played)
        for machine, path, name in zip(data["machines"], paths, (given.a, given.b), strict=True):
            machine["source"] = name
            data["notes"] = [note.replace(str(path), name) for note in data["notes"]]
        return data

    async def designs(self, _given: Nothing) -> list[dict[str, Any]]:
        """The designs that this studio has started."""
        return self._designs.told()

    async def again(self, given: OneRun) -> dict[str, Any]:
        """What the form of a design begins with to repeat a run."""
        return await asyncio.to_thread(self._designs.again, given.run)

    async def begin_design(self, form: NewDesign) -> dict[str, str]:
        """Start a design."""
        return {"run": await self._designs.start(form)}

    async def estimate(self, form: NewDesign) -> dict[str, Any]:
        """About how much a design would need."""
        plan = await asyncio.to_thread(require_possible, form)
        found = estimate(plan)
        pace = await asyncio.to_thread(self._listing.pace, form.task)
        seconds = usual_seconds(plan) * pace
        last = await asyncio.to_thread(self._listing.call_costs, plan.config.model.name)
        return {
            "calls": found.calls,
            "simulations": found.rollouts,
            "seconds": round(seconds),
            **last,
        }

    async def connect(self, form: NewDesign) -> dict[str, Any]:
        """Ask the model of a design for one small machine, and say what came of it."""
        plan = await asyncio.to_thread(require_possible, form)
        found = await asyncio.to_thread(check_endpoint, plan.config)
        return {key: for_page(str(found[key] or "")) for key in ("problem", "machine")}

    async def stop_design(self, given: OneRun) -> dict[str, str]:
        """Stop a design that this studio has started."""
        await self._designs.stop(given.run)
        return {"run": given.run}

    async def resume_design(self, given: OneRun) -> dict[str, str]:
        """Continue a run that has stopped."""
        await self._designs.resume(given.run)
        return {"run": given.run}

    async def picture(self, given: OnePicture) -> Response:
        """A small picture of a machine as built."""
        machine = recorded_machine(self._folder.run(given.run), given.machine)
        content = await asyncio.to_thread(_small_picture, machine, SIZES[given.on])
        return Response(content, media_type="image/png")

    async def level(self, given: OnTask) -> dict[str, Any]:
        """One level in full, with drawings."""
        return await asyncio.to_thread(level_data, given.level.name)

    async def level_picture(self, given: LevelPicture) -> Response:
        """A picture of a level."""
        size = LARGE if given.on == "page" else SMALL
        content = await asyncio.to_thread(level_picture, given.level.name, size)
        return Response(content, media_type="image/png")

    async def sweep(self, given: OneSweep) -> dict[str, Any]:
        """The data of a sweep's page."""
        return await asyncio.to_thread(self._listing.sweep, self._folder.sweep(given.sweep))

    async def leaderboards(self, _given: Nothing) -> list[dict[str, Any]]:
        """A leaderboard for each benchmark that has scorecards, those of the folder first; kept
        until cards come or go, as drawing their machines takes seconds."""
        boards = await asyncio.to_thread(self._folder.cards)
        if boards != self._boards[0]:
            self._boards = boards, await asyncio.to_thread(lambda: [*map(leaderboard_data, boards)])
        return self._boards[1]

    async def follow(self, request: Request) -> Response:
        """The stream of one run, or of the list."""
        name = request.query_params.get("run")
        try:
            news = follow_list(self._listing) if name is None else self._one(name)
        except AgentflowError as error:
            return told(Refusal(400, str(error)))
        return StreamingResponse(as_stream(news), media_type="text/event-stream")

    def _one(self, name: str) -> AsyncIterator[News]:
        return follow_run(self._folder.run(name), name, self._designs)

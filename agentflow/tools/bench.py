"""The bench: where an agent works in one stage, through one method, `call`."""

import asyncio
import json
from collections.abc import Awaitable, Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from math import isfinite
from typing import Any

from agentflow.errors import DamagedError
from agentflow.machine.tree import Machine
from agentflow.runs.events import EvaluationEvent, QueryEvent, RunEvent, ToolEvent
from agentflow.runs.locations import Location, StageName
from agentflow.tools import designing, exploring, measuring
from agentflow.tools.host import BenchHost
from agentflow.tools.results import RefusedCall, StageEnded, ToolResult, ToolSpec
from agentflow.tools.schema import BenchTool
from agentflow.tools.workspace import Call, KnownMachines, StageBudget, Workspace

TOOLS = (
    BenchTool.of(designing.brief),
    BenchTool.of(
        designing.check,
        label="Build",
        with_controls=' With controls, a machine is an object: {"blocks": [...], "controls": '
        '[{"group": "motors", "at": 0, "for": 5, "level": 1}]}.',
    ),
    BenchTool.of(designing.describe),
    BenchTool.of(
        designing.edit,
        label="Revise",
        with_controls=" Three commands change the controls: `Control IDS-OR-GROUP at S for S level "
        "LEVEL`, `Uncontrol NUMBER` and `Set NUMBER at S for S level LEVEL` with what changes.",
    ),
    BenchTool.of(measuring.simulate, needs="simulations"),
    BenchTool.of(measuring.verify, needs="simulations"),
    BenchTool.of(exploring.explore_edits, needs="simulations", label="Revise"),
    BenchTool.of(exploring.tune, needs="controls", label="Revise"),
    BenchTool.of(measuring.query, needs="simulations", label="Query"),
    BenchTool.of(measuring.look, needs="pictures", label="Observe"),
    BenchTool.of(designing.history),
    BenchTool.of(measuring.submit),
)
"""All tools, in the order in which clients list them."""
WITH_CONTROLLERS = {
    "check": ' It may also have "controllers", which sense; the brief has their form.',
    "edit": " `Controllers JSON` or `Controllers none` writes all controllers, and `Set "
    "laws.NAME.p NUMBER` changes one number of them by its path, such as `outputs.0.scale`.",
    "query": ' The id "controllers" shows what sensors read and laws gave; properties are then '
    "their names, or [] for all.",
}
"""What the descriptions of tools add where machines may sense."""
TOOL_NAMES = frozenset(tool.spec.name for tool in TOOLS)
READING = frozenset({"brief", "describe", "query", "look", "history"})
"""Tools that change nothing, and still answer once the last stage has ended."""
UNKNOWN = "unknown"
"""Name in the record of tools that do not exist, of which agents may call any number."""
MOST_CHARACTERS = 200_000
"""Most characters of a text from an agent; a machine of 800 blocks has 50,000."""
DEEPEST = 12
"""Deepest nesting of arguments; a machine with controllers as data needs 10."""
RECORDED = 2000
"""Most characters of a string in the record of a call."""


class Bench:
    """Tools over one task, with a budget."""

    def __init__(
        self, host: BenchHost, stage: StageName, budget: StageBudget, machines: KnownMachines
    ) -> None:
        """Open it for one stage; stages of a run share `machines`."""
        self._workspace = Workspace(host, stage, budget, machines)
        self._tools = {tool.spec.name: tool for tool in TOOLS if self._offers(tool)}
        self._calls = 0
        self._unfinished: set[asyncio.Event] = set()
        """One for each call in progress, set when it finishes."""
        self.reason = ""
        """Why the stage ended before its last submission; "" if it did not."""

    def _offers(self, tool: BenchTool) -> bool:
        budget, limits = self._workspace.budget, self._workspace.host.brief.limits
        charged = {
            "simulations": budget.simulations,
            "pictures": budget.pictures,
            "controls": None if limits.controls is None else budget.simulations,
        }
        return not tool.needs or charged[tool.needs] is not None

    @property
    def tools(self) -> tuple[ToolSpec, ...]:
        """The tools on offer in this stage."""
        return tuple(self._spec_of(tool) for tool in self._tools.values())

    @property
    def reading(self) -> tuple[ToolSpec, ...]:
        """Those that `review` calls."""
        return tuple(spec for spec in self.tools if spec.name in READING)

    def _spec_of(self, tool: BenchTool) -> ToolSpec:
        """A tool as clients see it: where machines bring controls, also how to write them."""
        spec, controlled = tool.spec, self._workspace.host.brief.limits.controls is not None
        more = tool.with_controls * controlled
        if self._workspace.host.brief.limits.senses:
            more += WITH_CONTROLLERS.get(spec.name, "")
            if tool.function is measuring.query:
                parameters = deepcopy(spec.parameters)
                item = parameters["properties"]["queries"]["items"]
                item["properties"]["properties"] = measuring.NAMES
                spec = replace(spec, parameters=parameters)
        return replace(spec, description=spec.description + more)

    @property
    def machines(self) -> KnownMachines:
        """The machines of the run so far, by name."""
        return self._workspace.machines

    @property
    def submitted(self) -> Sequence[Machine]:
        """The submitted machines, in order."""
        return tuple(self._workspace.submitted)

    @property
    def brief_text(self) -> str:
        """The answer of the tool `brief`; reading it is not a call."""
        return self._workspace.brief_text

    @property
    def budget_text(self) -> str:
        """What is left of the budget, in one sentence."""
        return self._workspace.budget_text

    @property
    def ended(self) -> bool:
        """Whether the stage has ended, by its last submission or by `end`."""
        return self._workspace.ended.is_set()

    async def wait_ended(self) -> None:
        """Wait until the stage has ended."""
        await self._workspace.ended.wait()

    def end(self, reason: str = "") -> None:
        """End the stage with what has been submitted; the reason is shown where machines are
        missing."""
        self.reason = self.reason or reason
        self._workspace.ended.set()

    async def close(self) -> None:
        """End the stage, and wait until the calls in progress have been refused."""
        self.end()
        for finished in tuple(self._unfinished):
            await finished.wait()

    async def call(self, name: str, arguments: object) -> ToolResult:
        """Call a tool. Cancelling this call cancels what it waits for, at no charge.

        A call that is still in progress when the stage ends is cancelled, and refused.

        Args:
            name: Name of the tool.
            arguments: An object as JSON data, or its JSON text; None for none. They come from an
                agent, so anything is allowed, and what does not fit is refused.
        """
        self._calls += 1
        finished = asyncio.Event()
        self._unfinished.add(finished)
        location = Location(self._workspace.stage, call=self._calls)
        try:
            return await self._answer(name, arguments, location)
        finally:
            self._unfinished.remove(finished)
            finished.set()

    async def _answer(self, name: str, arguments: object, location: Location) -> ToolResult:
        """Carry out a call or refuse it, and record it."""
        given: Mapping[str, Any] = {}
        code, call = "", Call(self._workspace, location)
        try:
            if self.ended:
                raise StageEnded
            given = _read_arguments(arguments)
            result = await self._before_end(self._find(name)(call, given))
        except RefusedCall as refused:
            code, result = refused.code, refused.result
        self._note(location, name, given, result, code)
        return result

    async def review(self, name: str, arguments: object) -> ToolResult:
        """Call a tool of `reading` once the stage has ended; the run does not record it."""
        call = Call(self._workspace, Location(self._workspace.stage), recorded=False)
        try:
            if name not in READING:
                raise StageEnded
            return await self._find(name)(call, _read_arguments(arguments))
        except RefusedCall as refused:
            return refused.result

    async def _before_end(self, work: Awaitable[ToolResult]) -> ToolResult:
        """The result of a call, or refuse it once the stage has ended without it."""
        job, end = asyncio.ensure_future(work), asyncio.ensure_future(self.wait_ended())
        try:
            await asyncio.wait({job, end}, return_when=asyncio.FIRST_COMPLETED)
            if job.done():
                return job.result()
            raise StageEnded
        finally:
            for task in (job, end):
                task.cancel()
            await asyncio.gather(job, end, return_exceptions=True)

    async def repeat(self, event: RunEvent, load: Callable[[str], Machine]) -> None:
        """Do again what an earlier process recorded of a call of this stage.

        Its simulation is made again and charged; its answer is copied.

        Args:
            event: An event of the call; others are ignored.
            load: Content hash -> machine.

        Raises:
            DamagedError: The recorded call is none that a bench could have answered.
        """
        self._calls = max(self._calls, event.location.call)
        try:
            await self._repeat(event, load)
        except RefusedCall as error:
            raise DamagedError(f"the recorded call {event.label} is damaged: {error}") from None

    async def _repeat(self, event: RunEvent, load: Callable[[str], Machine]) -> None:
        workspace, location = self._workspace, event.location
        if isinstance(event, EvaluationEvent) and location.call:
            await workspace.simulate([load(event.machine)], location)
        elif isinstance(event, QueryEvent):
            await workspace.host.query(load(event.machine), event.queries, location)
        elif isinstance(event, ToolEvent):
            if event.machine:
                self._take_over(event, load(event.machine))
            workspace.host.note(event)

    def _take_over(self, event: ToolEvent, machine: Machine) -> None:
        """What a successful call has left in the workspace."""
        workspace, given = self._workspace, self._find(event.tool).read(event.arguments)
        parent = {
            designing.edit.__name__: given.get("machine"),
            exploring.tune.__name__: given.get("machine"),
            designing.check.__name__: given.get("parent"),
        }.get(event.tool)
        origin = workspace.machines.find(parent).name if parent else ""
        known = workspace.name(machine, origin, given.get("script", ""), given.get("note", ""))
        if event.tool == measuring.submit.__name__:
            workspace.submit(known, given["last"])
        elif event.tool == measuring.verify.__name__:
            workspace.charge_changes(known)
        elif event.tool == measuring.look.__name__:
            pictures = workspace.budget.pictures
            if pictures and (given["time"] is not None or given["moments"]):
                pictures.take()

    def _find(self, name: str) -> BenchTool:
        if name in self._tools:
            return self._tools[name]
        why = "is not on offer in this stage" if name in TOOL_NAMES else "does not exist"
        raise RefusedCall(
            f"the tool {ascii(name)[:40]} {why}; the tools are {', '.join(self._tools)}"
        )

    def _note(
        self,
        location: Location,
        name: str,
        arguments: Mapping[str, Any],
        result: ToolResult,
        code: str,
    ) -> None:
        machine = None if result.refused else result.data.get("machine")
        known = self._workspace.machines.find(machine) if isinstance(machine, str) else None
        self._workspace.host.note(
            ToolEvent(
                location,
                tool=name if name in TOOL_NAMES else UNKNOWN,
                arguments=_shorten(arguments),
                refused=result.refused,
                code=code,
                answer=_shorten(result.text),
                machine=known.machine.digest if known else None,
            )
        )


def _read_arguments(arguments: object) -> Mapping[str, Any]:
    """The arguments as an object, or refuse."""
    if isinstance(arguments, str):
        text = _clean(arguments)
        try:
            arguments = json.loads(text) if text.strip() else None
        except (ValueError, RecursionError) as error:
            problem = f"the arguments are not JSON ({str(error)[:100]})"
            raise RefusedCall(f"{problem}; send a JSON object") from None
    if arguments is None:
        return {}
    if not isinstance(arguments, Mapping):
        raise RefusedCall(f"the arguments are a {type(arguments).__name__}; send a JSON object")
    clean: Mapping[str, Any] = _clean(arguments)
    return clean


def _clean(value: Any, depth: int = 0) -> Any:
    """Data from an agent as plain JSON data that can be encoded as UTF-8."""
    if depth > DEEPEST:
        raise RefusedCall(f"the arguments are nested more than {DEEPEST} deep; send flatter ones")
    if isinstance(value, str):
        if len(value) > MOST_CHARACTERS:
            size = f"an argument has {len(value)} characters"
            raise RefusedCall(f"{size}; send at most {MOST_CHARACTERS}")
        return value.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace")
    if isinstance(value, Mapping):
        return {_clean(str(key)): _clean(item, depth + 1) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_clean(item, depth + 1) for item in value]
    plain = value is None or isinstance(value, bool | int)
    return value if plain or (isinstance(value, float) and isfinite(value)) else str(value)


def _shorten(value: Any) -> Any:
    """Clean data, cut to a sane length for the record."""
    if isinstance(value, str) and len(value) > RECORDED:
        return f"{value[:RECORDED]}... ({len(value)} characters)"
    if isinstance(value, Mapping):
        return {key[:40]: _shorten(item) for key, item in list(value.items())[:20]}
    if isinstance(value, list):
        return [*map(_shorten, value[:20]), *(["..."] if len(value) > 20 else [])]
    return value

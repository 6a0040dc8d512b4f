"""The tools that need the simulation: simulate, query, look; and submit."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from typing import Annotated, Any

from pydantic import BaseModel, Field, WithJsonSchema

from agentflow.errors import UsageError
from agentflow.machine.tree import Machine
from agentflow.tools.host import Shot, SimulationSummary, Told, ViewDirection
from agentflow.tools.results import RefusedCall, ToolResult, brief_numbers
from agentflow.tools.workspace import Call, KnownMachine, Workspace, require_complete

MOST_AT_ONCE = 8
Trial = Annotated[int, Field(ge=0)]
_FRAME = " In the world frame; forces and moments along the axes of blocks as built:"
MOST_NOTED = 60
"""Most characters of a note or an edit in a table of results."""
NAMES: dict[str, Any] = {"type": "array", "items": {"type": "string"}, "maxItems": 8}
"""Schema of properties where some are names of sensors and laws, which a machine brings."""
_PROPERTIES = (
    "position",
    "rotation",
    "velocity",
    "angular_velocity",
    "length",
    "joint_angle",
    "joint_speed",
    "pull",
    "work",
    "load",
)


class Query(BaseModel):
    """What to show of a block, a moving object of the scene, or all connections."""

    id: int | Annotated[str, Field(max_length=80)]
    duration: Annotated[list[float], Field(min_length=2, max_length=2)]
    properties: Annotated[
        list[str],
        Field(max_length=8),
        WithJsonSchema(
            {
                "type": "array",
                "items": {"enum": [*_PROPERTIES], "type": "string"},
                "minItems": 1,
                "maxItems": 8,
            }
        ),
    ]


async def simulate(
    call: Call,
    machine: str | Annotated[list[str], Field(min_length=1, max_length=MOST_AT_ONCE)],
    trial: Trial = 0,
) -> ToolResult:
    """Simulate a machine: returns score, status and feedback; doing it again costs nothing.

    Args:
        machine: Name of the machine; or a list of up to 8 names, which are simulated at the same
            time and compared in a table with a row for each.
        trial: In tasks with trials, number of the trial that the feedback tells about; by default
            the one with the middle conditions, the same for every machine.
    """
    if isinstance(machine, str):
        return await _simulate_one(call, machine, trial)
    return await _compare(call, machine, trial)


async def _simulate_one(call: Call, machine: str, trial: int) -> ToolResult:
    workspace = call.workspace
    known = workspace.machines.find(machine)
    before = workspace.result_of(known.machine)
    (result,) = await _simulate(call, [known.machine])
    told = "It was simulated before, so this cost nothing." if before else ""
    if _is_greatest(workspace, result):
        told = f"No machine can score higher; `submit` it. {told}"
    happened = await _feedback(workspace, known.machine, trial)
    broke = _breaks(happened.data) if "trials" in happened.data else ""
    happening = f"{happened.text}\nFirst break: {broke}" if broke else happened.text
    frame = _FRAME * bool(happened.data)
    text = f"Machine {known.name}: {_result_text(result)}{frame}\n{happening}\n{told}"
    data = {
        "score": result.score,
        "status": result.status,
        "feedback": happened.text,
        "numbers": brief_numbers(happened.data),
    }
    return _counted(workspace, text, {"machine": known.name, **data, "known": before is not None})


async def _compare(call: Call, names: Sequence[str], trial: int) -> ToolResult:
    """Simulate several machines at once; one row for each."""
    workspace = call.workspace
    named = {(found := workspace.machines.find(name)).name: found for name in names}
    asked = list(named.values())
    results = await _simulate(call, [known.machine for known in asked])
    told = [await _feedback(workspace, known.machine, trial) for known in asked]
    moment = next((m["name"] for item in told if (m := item.data.get("moment"))), "")
    head = ["machine", "score", "status", *([moment] if moment else []), "first break"]
    rows, lines = [], [" | ".join([*head, "result", "note"])]
    for known, result, happened in zip(asked, results, told, strict=True):
        about = {
            "machine": known.name,
            "score": result.score,
            "status": result.status,
            **({"moment": _moment_text(happened.data)} if moment else {}),
            "first_break": _breaks(happened.data, result.broken) or "none",
            "result": _first_finding(happened.text),
            "note": known.note or known.script or None,
        }
        score = "-" if result.score is None else f"{result.score:.2f}"
        note = "; ".join((known.note or known.script or "-").split("\n"))[:MOST_NOTED]
        lines.append(" | ".join(map(str, {**about, "score": score, "note": note}.values())))
        numbers = brief_numbers(happened.data)
        rows.append({**about, "feedback": happened.text, "numbers": numbers})
    if any(_is_greatest(workspace, result) for result in results):
        lines.append("No machine can score higher than the best of these; `submit` it.")
    lines.append("`simulate` one of them alone for its feedback, at no cost.")
    return _counted(workspace, "\n".join(lines), {"results": rows})


def _first_finding(feedback: str) -> str:
    """The first line of a feedback after the score, which says how it came about."""
    lines = [line for line in feedback.splitlines() if not line.startswith("Score:")]
    return lines[0].removeprefix("Result: ") if lines else "-"


def _breaks(data: Mapping[str, Any], broken: Sequence[tuple[int, int, float]] = ()) -> str:
    """The connection that broke first, and when; of several trials, in which; "" if none did."""
    trials = data.get("trials", [{"first_break": item} for item in broken[:1]])
    found = [(n, item) for n, trial in enumerate(trials, 1) if (item := trial.get("first_break"))]
    if not found:
        return ""
    number, (block, partner, time) = found[0]
    told = f"{block} off {partner} at {time:.2f} s"
    if "trials" not in data:
        return told
    which = ", ".join(str(number) for number, _ in found)
    some = f"something breaks in {len(found)} of {len(trials)} trials ({which})"
    return f"{told} in trial {number}; {some}"


def _moment_text(data: Mapping[str, Any]) -> str:
    """When the decisive moment of a simulation was, such as the release, and how fast it left."""
    if not data.get("moment"):
        return "none"
    release = data.get("release")
    left = f"{release['speed']:.1f} m/s at {release['elevation']:.0f} degrees, " if release else ""
    return f"{left}{data['moment']['time']:.2f} s"


def _is_greatest(workspace: Workspace, result: SimulationSummary) -> bool:
    greatest = workspace.host.brief.greatest
    return greatest is not None and result.score is not None and result.score >= greatest


async def verify(call: Call, machine: str) -> ToolResult:
    """Verify a simulated machine, as final scores are made: simulate it under small changes.

    Args:
        machine: Name of the machine; it costs a simulation for each change, and nothing when it is
            verified again.
    """
    known = _simulated(call.workspace, machine)
    told, cost = await call.workspace.verify(known)
    count = len(told.data["scores"])
    idle = f", {cost + 1 - count} of them for changes without effect" if cost >= count else ""
    paid = f"{cost} simulation{'s' * (cost != 1)}{idle}" if cost else "nothing"
    text = f"Machine {known.name}: {told.text}. `default` is as simulated before; this cost {paid}."
    return _counted(call.workspace, text, {"machine": known.name, **told.data, "cost": cost})


async def query(
    call: Call,
    machine: str,
    queries: Annotated[list[Query], Field(min_length=1, max_length=12)],
    interval: Annotated[float, Field(gt=0.0)] | None = None,
    trial: Trial = 0,
) -> ToolResult:
    """Show recorded states of a simulated machine as tables, in the world frame.

    Args:
        machine: Name of the machine.
        queries: Each names a block id or a moving object of the scene, an interval [from, to] in
            seconds since t = 0, and properties. Rotations are in degrees; `joint_angle` and
            `joint_speed` are those against the parent; `pull` (N) and `work` (J since t = 0) are
            those of springs and winches; `load` is that of its own connections. The id
            "connections" shows the `load` of all, up to the first break in the interval.
        interval: Seconds between rows, down to a simulation step (0.0083); by default 0.2, and
            0.02 around events.
        trial: In tasks with trials, number of the trial; by default as for `simulate`.
    """
    known = _simulated(call.workspace, machine)
    named = ({"interval": interval} if interval else {}) | ({"trial": trial} if trial else {})
    asked = [item.model_dump() | named for item in queries]
    location = call.location if call.recorded else None
    told = await call.workspace.host.query(known.machine, asked, location)
    return ToolResult(
        f"In the world frame:\n{told.text}",
        {"machine": known.name, "answers": brief_numbers(told.data)},
    )


async def look(
    call: Call,
    machine: str,
    view: ViewDirection = "iso",
    time: float | None = None,
    moments: Annotated[list[float], Field(max_length=4)] = [],  # noqa: B006 - never changed
    follow: int | Annotated[str, Field(max_length=80)] | None = None,
    within: Annotated[float, Field(gt=0.0, le=100.0)] = 12.0,
    trial: Trial = 0,
) -> ToolResult:
    """Look at a machine: a picture with axes, scale and block ids; as built, it costs nothing.

    Args:
        machine: Name of the machine.
        view: front (from z+), side (from x+), top, or iso.
        time: A time of its simulation, in seconds since t = 0, in stages with simulations; leave
            it out to see the machine at rest, as built.
        moments: Instead of `time`, up to four times, to see them side by side in one picture.
        follow: Block that the camera follows, with all that is still connected to it, or a moving
            object of the scene; leave it out for the root and all that is near it.
        within: Leave blocks farther than this from it out of the frame, m; small for a close view.
        trial: In tasks with trials, number of the trial; by default as for `simulate`.
    """
    workspace = call.workspace
    pictures = workspace.budget.pictures
    if pictures is None:
        raise RefusedCall("there are no pictures in this run; `describe` gives positions")
    times = tuple(moments) if time is None else (time, *moments)[:4]
    known = _simulated(workspace, machine) if times else workspace.machines.find(machine)
    shot = Shot(view, times, follow, within, trial)
    with pictures.using() if times else nullcontext():
        try:
            image = await workspace.host.evaluator.look(known.machine, shot)
        except UsageError as error:
            raise RefusedCall(str(error)) from None
    seconds = ", ".join(f"{each:g}" for each in times)
    states = f"state{'s' * (len(times) > 1)} nearest to {seconds} s"
    when = f"the recorded {states}, world frame" if times else "at rest, as built, machine frame"
    data = {"machine": known.name, "view": view, "time": time, "moments": list(times)}
    told = _counted(workspace, f"Machine {known.name}, {view} view, {when}.", data)
    return ToolResult(told.text, told.data, image)


async def submit(call: Call, machine: str, last: bool = False) -> ToolResult:
    """Submit a machine as an answer of this stage; the last submission ends the stage.

    Args:
        machine: Name of the machine.
        last: End the stage with this submission, even if more are left.
    """
    workspace = call.workspace
    known = workspace.machines.find(machine)
    workspace.require_submittable(known)
    require_complete(known.machine, workspace.host.brief)
    told = "."
    if workspace.budget.simulations is not None:
        (result,) = await _simulate(call, [known.machine])
        told = f": {_result_text(result)}"
    workspace.submit(known, last)
    number = f"submission {len(workspace.submitted)} of {workspace.budget.submissions}"
    text = f"Machine {known.name} is {number}{told}"
    text += "\nThis stage has ended." if workspace.ended.is_set() else ""
    return _counted(workspace, text, {"machine": known.name, "ended": workspace.ended.is_set()})


async def _simulate(call: Call, machines: Sequence[Machine]) -> list[SimulationSummary]:
    for machine in machines:
        require_complete(machine, call.workspace.host.brief)
    return await call.workspace.simulate(machines, call.location)


def _simulated(workspace: Workspace, name: str) -> KnownMachine:
    """A machine whose simulation this stage may know."""
    known = workspace.machines.find(name)
    if workspace.budget.simulations is None:
        raise RefusedCall("this stage has no simulation, so there are no recorded states")
    if workspace.result_of(known.machine) is None:
        raise RefusedCall(f"machine {known.name} has not been simulated; `simulate` it first")
    return known


async def _feedback(workspace: Workspace, machine: Machine, trial: int) -> Told:
    """What happened to a simulated machine, or refuse a trial that does not exist."""
    try:
        return await workspace.host.evaluator.feedback(machine, trial)
    except UsageError as error:
        raise RefusedCall(str(error)) from None


def _result_text(result: SimulationSummary) -> str:
    score = "no score" if result.score is None else f"score {result.score:.2f}"
    ended = "" if result.status == "ok" else f" ({result.status})"
    return f"{score}{ended}."


def _counted(workspace: Workspace, text: str, data: Mapping[str, object]) -> ToolResult:
    """A result with what is left of the budget."""
    return ToolResult(
        f"{text.rstrip()}\n{workspace.budget_text}", {**data, **workspace.budget_data}
    )

"""Messages to the user during a run: remarks, which are recorded, and calls in progress."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from agentflow.app.design.conditions import code_change
from agentflow.llm.messages import Client, ClientWrapper, Reply, Request
from agentflow.models.choices import Models
from agentflow.runs import Listener, Notify, RunDirectory, read_document, read_events
from agentflow.runs.events import CallsEvent, RemarkEvent
from agentflow.runs.locations import Location
from agentflow.runs.reading import EVENTS

REMARK = RemarkEvent.kind
"""Kind of the events that `Remarks` records; replays ignore them."""
FAILED = {"diverged", "timeout", "crashed"}
"""Statuses of rollouts without a measured score."""
SEVERAL = 3
"""Rollouts that have failed, from which on it may be the task's fault."""


class Remarks:
    """Lines for the user that are also recorded as numbered events of the run."""

    def __init__(self, run: RunDirectory, notify: Notify) -> None:
        self._run, self._notify = run, notify
        self._count = sum(event.kind == REMARK for event in read_events(run.path))

    def tell(self, line: str) -> None:
        """Show a line to the user and record it."""
        self._notify(line)
        self.record(line)

    def record(self, line: str) -> None:
        """Record a line that the user is shown elsewhere."""
        self._count += 1
        self._run.event(RemarkEvent(Location(str(self._count)), line))

    def tell_differences(self) -> None:
        """Report any differences between this process and the record of an earlier one."""
        for line in _differences(self._run):
            self.tell(line)


def tell_unusable(remarks: Remarks, task: str, statuses: Mapping[str, int]) -> None:
    """Say so if no simulation of a run went through, which scores and pictures do not show.

    `statuses` counts the rollouts by status; a single machine may well be to blame for its own.
    """
    count = sum(statuses.values())
    if count >= SEVERAL and statuses.keys() <= FAILED:
        remarks.tell(
            f"all {count} simulations failed ({', '.join(sorted(statuses))}), so the scores say "
            "nothing about the machines: if other machines fare no better, the level or the family "
            f"of {task} needs repair"
        )


def _differences(run: RunDirectory) -> Iterator[str]:
    if run.dropped:
        yield f"{run.path / EVENTS}: dropped a half-written last line ({run.dropped} bytes)"
    missing = [event for event in run.unreproduced() if event.kind != REMARK]
    for what, events, kept in (
        ("now differ", run.replaced, "both versions are kept, the later one counts"),
        ("were not reproduced", missing, "they are kept"),
    ):
        for first in events[:1]:
            yield (
                f"recorded events that {what}: {len(events)} (first: {first.kind} {first.label}), "
                f"because {_why(run)}; {kept}"
            )


def _why(run: RunDirectory) -> str:
    """What made a run differ from its record, as far as is known."""
    if change := code_change(read_document(run.path)):
        return (
            f"agentflow has changed since the run began ({change}), not because of what you did: "
            "to compare scores, begin a new run"
        )
    return f"a file in {run.path} was edited, or a simulation that had been cut off went through"


def watch_calls(models: Models, listener: Listener) -> Models:
    """The same models; `listener` receives an event whenever a call begins or ends."""
    in_progress = 0

    def count(label: str, change: int) -> None:
        nonlocal in_progress
        in_progress += change
        listener(CallsEvent(Location.parse(label), in_progress, models.budget.cost))

    watched = {id(client): _WatchedClient(client, count) for client in models.clients.values()}
    return replace(models, clients={role: watched[id(c)] for role, c in models.clients.items()})


class _WatchedClient(ClientWrapper):
    """Reports the beginning (+1) and the end (-1) of each call, by label."""

    def __init__(self, inner: Client, count: Callable[[str, int], None]) -> None:
        super().__init__(inner)
        self._count = count

    async def complete(self, request: Request) -> Reply:
        self._count(request.label, 1)
        try:
            return await self._inner.complete(request)
        finally:
            self._count(request.label, -1)

"""The data of a run's page as JSON: tree, curve, tables, conversations; no machines or films."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from agentflow.holding import with_holding
from agentflow.metrics.tables import counted
from agentflow.metrics.usage import Cost, summarize_usage
from agentflow.report.elites import archive_of, classes_of
from agentflow.report.film import deflate_json
from agentflow.report.lineage import Lineage, LineageNode
from agentflow.runs import Event, read_calls, read_document, state_of
from agentflow.runs.events import (
    AttemptEvent,
    EvaluationEvent,
    NicheEvent,
    RunEvent,
    RunStartEvent,
    ToolEvent,
    VerificationEvent,
    read_typed_events,
)
from agentflow.runs.locations import Location, stage_words
from agentflow.runs.record import RunRecord
from agentflow.runs.result import BUDGET, RunResult

UNFINISHED = {"running": "in progress", "stopped": "unfinished", "done": "finishing"}
"""How the page describes a run without a result, by state; it may end while it is read."""
EXAMPLE = 200
"""Characters shown of an example of a refusal."""


@dataclass(frozen=True)
class RunStory:
    """A recorded run, finished or not."""

    path: Path
    document: Mapping[str, Any]
    result: RunResult | None
    """None for an unfinished run."""
    events: Sequence[RunEvent | Event]
    nodes: tuple[LineageNode, ...]

    @classmethod
    def read(cls, path: Path, result: RunResult | None, best: str | None) -> RunStory:
        """Read a run directory; `best` is the content hash of the resulting machine."""
        events = tuple(read_typed_events(path))
        return cls(path, read_document(path), result, events, Lineage.of(events).finish(best))

    @property
    def machines(self) -> dict[str, LineageNode]:
        """Content hash -> the first node with that machine, highest scores first."""
        shown = [node for node in self.nodes if node.machine is not None]
        shown.sort(key=lambda node: -1.0 if node.score is None else node.score, reverse=True)
        found: dict[str, LineageNode] = {}
        for node in shown:
            found.setdefault(str(node.machine), node)
        return found

    @property
    def _model(self) -> str:
        """What answered; "" if that is not known yet."""
        if self.result is not None:
            return self.result.model
        return next((e.model for e in self.events if isinstance(e, RunStartEvent)), "")

    @property
    def _begun(self) -> int:
        """Number of the last trajectory: a search over the whole run begins as many as it likes."""
        made = (e.location for e in self.events if isinstance(e, EvaluationEvent))
        return max((location.trajectory for location in made), default=0)

    @property
    def _result_data(self) -> Mapping[str, Any]:
        """The result as data; empty for an unfinished run."""
        return {} if self.result is None else self.result.to_json()

    def classes(self, seen: Mapping[str, str | None]) -> list[dict[str, Any]]:
        """The best machine of each mechanism class; `seen` are classes by content hash.

        What the run itself recorded comes first.
        """
        niches = (event for event in self.events if isinstance(event, NicheEvent))
        recorded = {event.machine: event.mechanism for event in niches if event.mechanism}
        return classes_of(self.machines, {**seen, **recorded})

    def to_json(self, cost: Cost, priced: bool) -> dict[str, Any]:
        """Everything except machines and films; `priced` is whether any prices are known."""
        attempts = [event for event in self.events if isinstance(event, AttemptEvent)]
        record = RunRecord.of(self.events)
        return {
            "kind": "run",
            "run": self._head(record, priced),
            "nodes": [asdict(node) for node in self.nodes],
            "progress": score_curve(self.events),
            "archive": archive_of(self.events),
            "front": self._result_data.get("front"),
            "makers": self._result_data.get("makers"),
            "stages": [
                {**stage.data, "words": stage_words(stage.location.name, self._model)}
                for stage in record.stages
            ],
            "validity": validity(attempts),
            "reasons": rejection_reasons(attempts),
            "usage": usage(read_calls(self.path), cost),
            "tools": [tool_call(item) for item in self.events if isinstance(item, ToolEvent)],
            "talk": call_labels(read_calls(self.path)),
            "calls": deflate_json(conversations(read_calls(self.path), attempts)),
            "facts": list(self._facts().items()),
        }

    def _head(self, record: RunRecord, priced: bool) -> dict[str, Any]:
        config = self.document.get("config", {})
        model = self._model or config.get("model", {}).get("name") or ""
        return {
            "task": config.get("task", ""),
            "workflow": config.get("workflow", ""),
            "author": model,
            "seed": config.get("seed", 0),
            "trajectories": config.get("settings", {}).get("trajectories"),
            "begun": self._begun,
            "score": self.result.score if self.result else record.best,
            "verified": with_holding(self._result_data.get("verified")),
            "passed": self._passed_over(),
            "sentence": self._sentence(record.best is not None),
            "about": f"{model}: "
            + f"{counted(record.calls, 'call')}, " * bool(record.calls)
            + f"{counted(len(record.machines), 'machine')} simulated",
            "prices": priced,
        }

    def _passed_over(self) -> dict[str, Any] | None:
        """The verified machine with the highest plain score, if another one was chosen: its result
        (see `FinalistResult`), its title, where its score holds, and the mean of the chosen one."""
        finalists = (self.result.finalists if self.result else None) or ()
        known = {one.machine: one for one in finalists}
        own = next((known[n.machine] for n in self.nodes if n.best and n.machine in known), None)
        first = max(finalists, key=lambda one: one.score, default=None)
        if own is None or first is None or first.score <= own.score:
            return None
        tested = (e for e in self.events if isinstance(e, VerificationEvent))
        found = next((e.holding for e in tested if e.machine == first.machine), None)
        title = next((n.title for n in self.nodes if n.machine == first.machine), "another machine")
        holds = {"holds": found.holds, "of": found.of} if found else {}
        return {**first.model_dump(mode="json"), "title": title, "chosen": own.mean, **holds}

    def _sentence(self, scored: bool) -> str:
        if self.result is None:
            so_far = "is the best so far" if scored else "yet"  # follows the score
            state = state_of(self.path)
            unverified = ", so it is not verified" * (scored and state == "stopped")
            return f"{so_far}: the run is {UNFINISHED[state]}{unverified}"
        end = "; its budget was used up" * (self.result.stopped == BUDGET)
        if not self.result.valid:
            return (self.result.reason or "no valid machine was found") + end
        stage = self.result.best_stage and stage_words(self.result.best_stage, self._model)
        if not self.result.score:  # the page says why
            return f"is the highest score{end}"
        place = f" found in {stage}" if stage else ""
        return f"by the best machine{',' * bool(place)}{place}{end}"

    def _facts(self) -> dict[str, str]:
        document = self.document
        config = document.get("config", {})
        place = "/".join(self.path.resolve().parts[-2:])
        again = "Resume" if self.result is None else "Replay"
        command = "design --resume" if self.result is None else "replay"
        how = f"agentflow {command} {shlex.quote(place)}"
        if self.result is None and "answer" in document:
            how = f"agentflow.resume({place!r}, answer=...) in Python"
        settings, budget = config.get("settings", {}), config.get("model", {}).get("budget", {})
        asked = {  # named as in the form of the studio
            "Trajectories": settings.get("trajectories"),
            "Search rounds": settings.get("search", {}).get("rounds"),
            "Max calls": budget.get("calls"),
            "Max tokens": budget.get("tokens"),
        }
        facts = {
            "Run": str(self.path.name),
            again: how,
            **{name: str(value) for name, value in asked.items() if value is not None},
            "Knobs": ", ".join(f"{k} = {v}" for k, v in config.get("knobs", {}).items()) or "none",
            "Prompt set": f"{config.get('prompts', '')} {document.get('prompts', '')}",
            "Physics engine": str(document.get("engine") or "not recorded"),
            "Physical constants": str(document.get("constants", "")),
            "agentflow": f"{document.get('agentflow', '')} {document.get('commit') or ''}",
            "Python": f"{document.get('python', '')}, {document.get('platform', '')}",
        }
        if self.result is not None:
            facts["Duration"] = f"{self.result.seconds} s"
        return facts


def score_curve(events: Iterable[RunEvent | Event]) -> list[dict[str, Any]]:
    """Score and machine of each evaluation that has one, and the cost of the run up to then."""
    run, points = RunRecord(), []
    for event in events:
        run.add(event)
        if isinstance(event, EvaluationEvent) and event.score is not None:
            spent = {"expansions": run.steps, "calls": run.calls, "tokens": run.tokens}
            points.append(
                {**spent, "seconds": event.at, "score": event.score, "machine": event.machine}
            )
    return points


def validity(attempts: Iterable[AttemptEvent]) -> list[dict[str, Any]]:
    """Per role: replies, and how many of them were parsed, valid, or repaired."""
    rows: dict[str, dict[str, Any]] = {}
    for attempt in attempts:
        empty = {"role": attempt.role, "attempts": 0, "parsed": 0, "valid": 0, "repaired": 0}
        row = rows.setdefault(attempt.role, empty)
        row["attempts"] += 1
        row["parsed"] += attempt.parsed
        row["valid"] += attempt.valid
        row["repaired"] += attempt.repaired
    return list(rows.values())


def rejection_reasons(attempts: Iterable[AttemptEvent]) -> list[dict[str, Any]]:
    """Why replies were refused: code, count and an example, most frequent first."""
    refused = [attempt for attempt in attempts if not attempt.valid]
    examples = {a.code: a.problem[:EXAMPLE] for a in reversed(refused)}
    counted = Counter(attempt.code for attempt in refused)
    return [
        {"code": code or "unnamed", "count": count, "example": examples[code]}
        for code, count in counted.most_common()
    ]


def usage(calls: Iterable[Mapping[str, Any]], cost: Cost) -> list[dict[str, Any]]:
    """Tokens, seconds and money per role and in total."""
    found = summarize_usage(calls, cost)
    if not found.total.calls:
        return []
    return [
        {
            "role": role,
            "calls": spent.calls,
            "prompt": spent.prompt,
            "completion": spent.completion,
            "reasoning": spent.reasoning,
            "cached": spent.cached,
            "seconds": round(spent.seconds, 2),
            "cost": None if spent.money is None else round(spent.money, 6),
        }
        for role, spent in (*found.roles.items(), ("all", found.total))
    ]


def tool_call(event: ToolEvent) -> dict[str, Any]:
    """A call of a tool: its label, what the agent sent, and the answer."""
    given = event.arguments if isinstance(event.arguments, Mapping) else {}
    sent = "\n".join(f"{name}: {value}" for name, value in given.items())
    return {
        "label": f"{event.location.words}: {event.tool}",
        "refused": event.refused,
        "sent": sent,
        "answer": event.answer,
    }


def call_labels(calls: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The labels of all calls, by role."""
    roles: dict[str, list[str]] = {}
    for call in calls:
        roles.setdefault(call["request"]["role"], []).append(call["request"]["label"])
    return [{"role": role, "labels": labels} for role, labels in roles.items()]


def conversations(
    calls: Iterable[Mapping[str, Any]], attempts: Iterable[AttemptEvent]
) -> dict[str, list[Any]]:
    """Every call with its verdict; repeated texts (such as system prompts) are stored once."""
    verdicts = {attempt.label: attempt for attempt in attempts}
    texts: dict[str, int] = {}
    found = []
    for call in calls:
        request, reply = call["request"], call["reply"]
        verdict = verdicts.get(request["label"])
        found.append(
            {
                "label": request["label"],
                "title": Location.parse(request["label"]).words,
                "valid": verdict.valid if verdict else None,
                "repaired": verdict is not None and verdict.repaired,
                "problem": verdict.problem if verdict else "",
                "messages": [
                    (message["role"], texts.setdefault(_text(message), len(texts)))
                    for message in request.get("messages", ())
                ],
                "reply": _text(reply),
                "reasoning": reply.get("reasoning", ""),
                "usage": reply["usage"],
                "latency": reply["latency_s"],
                "retries": reply["retries"],
            }
        )
    return {"texts": list(texts), "calls": found}


def _text(said: Mapping[str, Any]) -> str:
    """A message or reply as text, with its calls of tools."""
    calls = (f"{call['name']}({call['arguments']})" for call in said.get("tool_calls", ()))
    return "\n".join(filter(None, (said["text"], *calls)))

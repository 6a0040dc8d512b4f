"""Owns what the page of a run says: its tree, curves, tables and conversations, as JSON data.

Machines and films are added by whoever can simulate; the page itself is page.py's.
"""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agentflow.metrics.progress import progress
from agentflow.metrics.usage import Cost, Spent, bill
from agentflow.report.film import deflated_json
from agentflow.report.lineage import Lineage, Node
from agentflow.runs import Event, read_calls, read_document, read_events, state_of

UNFINISHED = {"running": "under way", "stopped": "unfinished", "done": "finishing"}
"""What the page says of a run without a result, by its state; it may end while it is read."""
EXAMPLE = 200
"""Characters of a refusal that are shown with its count."""


@dataclass(frozen=True)
class RunStory:
    """A run as it is recorded, finished or not."""

    path: Path
    document: Mapping[str, Any]
    result: Mapping[str, Any] | None
    """The content of result.json; None of an unfinished run."""
    events: Sequence[Event]
    nodes: tuple[Node, ...]

    @classmethod
    def read(cls, path: Path, result: Mapping[str, Any] | None, best: str | None) -> RunStory:
        """Read a run directory.

        Args:
            path: The run directory.
            result: Its result, if it has one.
            best: Content hash of the resulting machine.

        Raises:
            RunError: It is none, or is damaged.
        """
        events = tuple(read_events(path))
        return cls(path, read_document(path), result, events, Lineage.of(events).finished(best))

    @property
    def machines(self) -> dict[str, Node]:
        """Content hash -> the first node that shows it, the highest scores first."""
        shown = [node for node in self.nodes if node.machine is not None]
        shown.sort(key=lambda node: -1.0 if node.score is None else node.score, reverse=True)
        found: dict[str, Node] = {}
        for node in shown:
            found.setdefault(str(node.machine), node)
        return found

    def to_json(self, cost: Cost, priced: bool) -> dict[str, Any]:
        """Everything but machines and films.

        Args:
            cost: What a call costs.
            priced: Whether any prices are known.
        """
        attempts = [event for event in self.events if event.kind == "attempt"]
        return {
            "kind": "run",
            "run": self._head(priced),
            "nodes": [node.to_json() for node in self.nodes],
            "progress": [
                {
                    "expansions": point.expansions,
                    "calls": point.calls,
                    "tokens": point.tokens,
                    "score": point.score,
                }
                for point in progress(self.events)
                if point.score is not None
            ],
            "stages": [dict(event.data) for event in self.events if event.kind == "stage"],
            "validity": validity(attempts),
            "reasons": reasons(attempts),
            "usage": usage(read_calls(self.path), cost),
            "talk": talk(read_calls(self.path)),
            "calls": deflated_json(conversations(read_calls(self.path), attempts)),
            "facts": self._facts(),
        }

    def _head(self, priced: bool) -> dict[str, Any]:
        config = self.document.get("config", {})
        counted = Counter(event.kind for event in self.events)
        machines = len({e.data["machine"] for e in self.events if e.kind == "evaluation"})
        begun = (event.data.get("model") for event in self.events if event.kind == "run")
        known = ((self.result or {}).get("model"), *begun, config.get("model", {}).get("name"))
        model = next(filter(None, known), "")
        return {
            "task": config.get("task", ""),
            "workflow": config.get("workflow", ""),
            "seed": config.get("seed", 0),
            "score": self.result["score"] if self.result else self._highest(),
            "sentence": self._sentence(),
            "about": f"{model}: {counted['attempt']} calls, {machines} machines simulated",
            "prices": priced,
        }

    def _highest(self) -> float | None:
        return next((node.score for node in self.nodes if node.best), None)

    def _sentence(self) -> str:
        if self.result is None:
            known = any(node.best for node in self.nodes)
            return f"{'is the best so far: ' * known}the run is {UNFINISHED[state_of(self.path)]}"
        end = "; its budget was used up" * (self.result.get("stopped") == "budget")
        if not self.result["valid"]:
            return str(self.result.get("reason") or "no valid machine was found") + end
        stage = str(self.result.get("best_stage") or "").replace("_", " ")
        place = f" found in the stage {stage}" if stage else ""
        if not self.result["score"]:
            return f"is the most that any machine scored; shown is one{place}{end}"
        return f"the best machine{',' * bool(place)}{place}{end}"

    def _facts(self) -> list[tuple[str, str]]:
        said = self.document
        config = said.get("config", {})
        place = "/".join(self.path.resolve().parts[-2:])
        again = "Continue it" if self.result is None else "Repeat it"
        command = "design --resume" if self.result is None else "replay"
        facts = {
            "Run": str(self.path.name),
            again: f"agentflow {command} {shlex.quote(place)}",
            "Knobs": ", ".join(f"{k} = {v}" for k, v in config.get("knobs", {}).items()) or "none",
            "Prompt set": f"{config.get('prompts', '')} {said.get('prompts', '')}",
            "Physical constants": str(said.get("constants", "")),
            "agentflow": f"{said.get('agentflow', '')} {said.get('commit') or ''}",
            "Python": f"{said.get('python', '')}, {said.get('platform', '')}",
        }
        if self.result is not None and "seconds" in self.result:
            facts["Took"] = f"{self.result['seconds']} s"
        return list(facts.items())


def validity(attempts: Iterable[Event]) -> list[dict[str, Any]]:
    """Per role: replies, and how many of them could be parsed, were valid, had to be repaired."""
    rows: dict[str, dict[str, Any]] = {}
    for attempt in attempts:
        empty = {"role": attempt.data["role"], "attempts": 0, "parsed": 0, "valid": 0}
        row = rows.setdefault(attempt.data["role"], {**empty, "repaired": 0})
        row["attempts"] += 1
        for key in ("parsed", "valid", "repaired"):
            row[key] += bool(attempt.data[key])
    return list(rows.values())


def reasons(attempts: Iterable[Event]) -> list[dict[str, Any]]:
    """Why replies were refused: code, how often, one example; the most frequent first."""
    refused = [attempt for attempt in attempts if not attempt.data["valid"]]
    examples = {a.data["code"]: a.data["problem"][:EXAMPLE] for a in reversed(refused)}
    counted = Counter(attempt.data["code"] for attempt in refused)
    return [
        {"code": code or "unnamed", "count": count, "example": examples[code]}
        for code, count in counted.most_common()
    ]


def usage(calls: Iterable[Mapping[str, Any]], cost: Cost) -> list[dict[str, Any]]:
    """Tokens, seconds and money per role, and of all."""
    found = bill(calls, cost)
    if not found.total.calls:
        return []
    return [_spent(role, spent) for role, spent in (*found.roles.items(), ("all", found.total))]


def _spent(role: str, spent: Spent) -> dict[str, Any]:
    return {
        "role": role,
        "calls": spent.calls,
        "prompt": spent.prompt,
        "completion": spent.completion,
        "reasoning": spent.reasoning,
        "cached": spent.cached,
        "seconds": round(spent.seconds, 2),
        "cost": None if spent.money is None else round(spent.money, 6),
    }


def talk(calls: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The labels of all calls, by role."""
    roles: dict[str, list[str]] = {}
    for call in calls:
        roles.setdefault(call["request"]["role"], []).append(call["request"]["label"])
    return [{"role": role, "labels": labels} for role, labels in roles.items()]


def conversations(
    calls: Iterable[Mapping[str, Any]], attempts: Iterable[Event]
) -> dict[str, list[Any]]:
    """Every call with its verdict; texts that come again (system prompts) are kept once."""
    verdicts = {attempt.label: attempt.data for attempt in attempts}
    texts: dict[str, int] = {}
    found = []
    for call in calls:
        request, reply = call["request"], call["reply"]
        verdict = verdicts.get(request["label"], {})
        found.append(
            {
                "label": request["label"],
                "valid": verdict.get("valid"),
                "repaired": verdict.get("repaired", False),
                "problem": verdict.get("problem", ""),
                "messages": [
                    (message["role"], texts.setdefault(message["text"], len(texts)))
                    for message in request.get("messages", ())
                ],
                "reply": reply["text"],
                "reasoning": reply.get("reasoning", ""),
                "usage": reply["usage"],
                "latency": reply["latency_s"],
                "retries": reply["retries"],
            }
        )
    return {"texts": list(texts), "calls": found}

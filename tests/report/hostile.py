"""A run as a hostile model would leave it: markup, control characters and a line without an end."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from agentflow.machine import Machine, read_machine
from agentflow.runs import Event, RunDirectory

MACHINES = Path(__file__).parent.parent / "machines"
BREAKS, HOLDS = "published_throw", "thrower_short_arm"
"""One machine that breaks, and one that does not."""
NASTY = (
    "<script>window.owned = 1</script></script><img src=x onerror='window.owned = 2'>"
    "<a href='javascript:window.owned = 3'>go</a><!-- ]]> & \\u003c \x00 \u202etxet\u202c \ufeff"
)
LONG = "<b>" + "x" * 1_000_000 + "</b>"
REASON = f"refused because of {NASTY}"
ASKED = "refiner/feedback/traj-1/round-1/node-0"


def machine(name: str) -> Machine:
    """A machine of the tests, with every block type."""
    found = read_machine((MACHINES / f"{name}.json").read_text(), range(1000)).machine
    assert found is not None
    return found


def hostile_run(folder: Path) -> Path:
    """Write the run: one trajectory, one good machine, one that breaks, one refused edit."""
    document: dict[str, Any] = {
        "agentflow": NASTY,
        "commit": NASTY,
        "prompts": "p",
        "constants": "none of today's",
        "python": "3",
        "platform": NASTY,
        "config": {"task": "throwing", "workflow": "hierarchical", "model": {"name": NASTY}},
    }
    run = RunDirectory.create(folder, "hostile", document)
    good, bad = machine(HOLDS), machine(BREAKS)
    for item in (good, bad):
        run.save_machine(item.digest, item.to_text())
    calls = [
        _attempt(run, "designer/traj-1/attempt-1", machine=good.digest),
        _attempt(run, f"{ASKED}/try-1/attempt-1", machine=bad.digest, script=f"Add {NASTY}"),
        _attempt(run, f"{ASKED}/try-2/attempt-1", valid=False, code="<b>bad</b>", problem=REASON),
    ]
    _evaluated(run, "initial/traj-1", good, 12.5, [])
    first = {"parsed": True, "spatial": True, "valid": True}
    outline = {"trajectory": 1, "machine": good.digest, "valid": True, "score": 12.5}
    run.event(Event("candidate", "initial/traj-1", {**outline, "first": first, "reason": ""}))
    search = "env_feedback/traj-1"
    attempts = [
        {"label": "round-1/node-0/try-1", "valid": True, "note": NASTY},
        {"label": "round-1/node-0/try-2", "valid": False, "note": REASON},
    ]
    run.event(
        Event(
            "expand",
            f"{search}/round-1",
            {"node": 0, "attempts": attempts, "children": [1], "fallback": False},
        )
    )
    _evaluated(run, f"{search}/round-1/node-1", bad, 0.0, [[8, 7, 0.4]])
    node = {"round": 1, "parent": 0, "made_by": "round-1/node-0/try-1"}
    run.event(
        Event(
            "node", f"{search}/node-1", {**node, "machine": bad.digest, "valid": True, "score": 0.0}
        )
    )
    axes = [
        {"name": NASTY, "unit": NASTY, "low": 0.0, "high": 2.0, "cells": 2, "labels": labels}
        for labels in ([NASTY, "motors"], [])
    ]
    run.event(Event("archive", search, {"axes": axes}))
    for number, (item, score) in enumerate([(good, 12.5), (bad, 0.0)]):
        data = {"score": score, "values": [number, number], "cell": [number, number]}
        found = {"round": number, "machine": item.digest, "outcome": "new", "mechanism": NASTY}
        run.event(Event("niche", f"{search}/node-{number}", {**found, **data}))
    run.call_log.write_text("".join(json.dumps(call) + "\n" for call in calls))
    run.close()
    return run.path


def _attempt(run: RunDirectory, label: str, **data: Any) -> dict[str, Any]:
    """Note an attempt; the line of its call."""
    role = label.partition("/")[0]
    known = {"role": role, "valid": True, "parsed": True, "spatial": True, "repaired": False}
    run.event(Event("attempt", label, {**known, "code": "", "problem": "", "tokens": 7, **data}))
    messages = [
        {"role": "system", "text": NASTY, "images": []},
        {"role": "user", "text": LONG, "images": []},
    ]
    usage = {"prompt": 5, "completion": 2, "reasoning": 1, "cached": 0}
    reply = {"text": NASTY, "finish": "stop", "reasoning": NASTY, "usage": usage}
    return {
        "schema_version": 1,
        "key": label,
        "model": NASTY,
        "request": {"role": role, "label": label, "messages": messages, "sampling": {}},
        "reply": {**reply, "model": NASTY, "latency_s": 0.5, "retries": 0},
    }


def _evaluated(
    run: RunDirectory, label: str, item: Machine, score: float, broken: list[list[float]]
) -> None:
    run.event(
        Event(
            "evaluation",
            label,
            {
                "machine": item.digest,
                "valid": True,
                "score": score,
                "status": "ok",
                "broken": broken,
                "rollout": "00",
                "moved": 1.0,
            },
        )
    )

"""Whether a rollout meets the requirements of its task, by how much, and what governs it."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import hypot, inf
from typing import Any

import numpy as np

from agentflow.env.constants import constants
from agentflow.env.feedback.text import body_name, number
from agentflow.env.measurements import Peak
from agentflow.env.rollout import Broken, Feedback, Rollout, Trace
from agentflow.env.rotations import rotate
from agentflow.env.simulation.variations import Variation
from agentflow.machine.brief import Brief
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.vectors import Vec3, dot, length, scale, subtract
from agentflow.machine.requirements import Judged, Mode, Requirement, count_met
from agentflow.machine.tree import Machine

DRAWS = 5
"""Rollouts with displaced blocks."""
NEAR = 0.1
"""How near an event must be to a load to explain it, s."""
ALONG = 0.7
"""Share of a force or moment along an axis above which it counts as along it: cos 45 degrees."""
SCORE_IF_MET = "score_if_met"
"""Term of the score without requirements."""


def displaced(variation: Variation, brief: Brief, seed: int) -> dict[Requirement, list[Variation]]:
    """The variations with displaced blocks that each requirement of a tolerance needs."""
    return {
        item: [
            replace(variation, displacement=item.within, draw=f"{seed}/displacement/{draw}")
            for draw in range(DRAWS)
        ]
        for item in brief.requirements.items
        if item.within
    }


def judge(
    rollout: Rollout, machine: Machine, brief: Brief, kept: Mapping[Requirement, Sequence[float]]
) -> Rollout:
    """The rollout with all requirements judged, and its score as it was.

    Args:
        rollout: Of one trial, with a score.
        machine: What was simulated.
        brief: Of its task.
        kept: The scores with displaced blocks, by requirement.
    """
    found = {item.requirement: item for item in brief.judge(place(machine))}
    for item in brief.requirements.items:
        if item in found:
            continue
        if rollout.trace is None or rollout.status != "ok":
            found[item] = Judged(item, None, f"the simulation ended as {rollout.status}")
        elif item.within:
            found[item] = _kept(item, rollout.score or 0.0, kept.get(item, ()))
        else:
            found[item] = Judged(item, *_READERS[item.quantity](rollout, rollout.trace, machine))
    return replace(rollout, requirements=tuple(found[item] for item in brief.requirements.items))


def apply(rollout: Rollout, brief: Brief) -> Rollout:
    """The rollout with its requirements in terms and feedback; they may cost the score."""
    judged, score = rollout.requirements, rollout.score
    if not judged or score is None or rollout.status != "ok":
        return rollout
    counts = brief.requirements.mode == "report" or all(item.met for item in judged)
    head, *rest = rollout.feedback.text.splitlines()
    if not counts:
        without = head.removeprefix("Score: ")
        head = f"Score: 0.00, as requirements are not met; without them it would be {without}"
    lines = [f"- {'met' if item.met else 'NOT MET'}: {item}" for item in judged]
    text = "\n".join([head, f"Requirements: {count_met(judged)}", *lines, *rest])
    final = score if counts else 0.0
    data: dict[str, Any] = {
        **rollout.feedback.data,
        "score": final,
        SCORE_IF_MET: score,
        "requirements": [item.to_json() for item in judged],
    }
    met = float(sum(item.met for item in judged))
    terms = {SCORE_IF_MET: score, "met": met, "required": float(len(judged))}
    return replace(
        rollout,
        score=final,
        terms={**rollout.terms, **terms},
        feedback=Feedback(text, data),
    )


def search_value(rollout: Rollout, mode: Mode) -> float | None:
    """What searches compare in place of the score of a machine that misses requirements; None if it
    misses none that cost the score.

    Below 0, so that any machine that meets all and scores comes first: minus the sum of shortfalls,
    so that a search climbs towards meeting all, or minus the number of requirements for machines
    that would not score at all (constrained dominance, Deb et al. 2002).
    """
    judged, without = rollout.requirements, rollout.terms.get(SCORE_IF_MET)
    if mode == "report" or not judged or rollout.score != 0.0:
        return None
    if not without:  # also of those that diverged
        return -float(len(judged))
    return -sum(item.shortfall for item in judged)


def worst(trials: Sequence[tuple[Judged, ...]]) -> tuple[Judged, ...]:
    """Each requirement where it is met least; the mean of what trials keep of their scores."""
    return tuple(map(_worst, zip(*trials, strict=True)))


def _worst(items: tuple[Judged, ...]) -> Judged:
    if items[0].requirement.within:
        known = [item.value for item in items if item.value is not None]
        return replace(
            items[0], value=statistics.mean(known) if known else None, cause="all trials"
        )
    margins = [-inf if item.margin is None else item.margin for item in items]
    index = margins.index(min(margins))
    cause = items[index].cause
    return replace(items[index], cause=f"{cause}, trial {index + 1}" if cause else "")


def _kept(item: Requirement, score: float, scores: Sequence[float]) -> Judged:
    if not scores:
        return Judged(item, None, "the score is 0")
    shares = [100.0 * one / score for one in scores]
    spread = f"{number(min(shares), 0)} to {number(max(shares), 0)} % in {len(shares)} draws"
    return Judged(item, statistics.mean(shares), spread)


def _safety(rollout: Rollout, trace: Trace, machine: Machine) -> tuple[float, str]:
    held = trace.measured.greatest
    loads: list[Peak | Broken] = [*rollout.broken, *([held] if held else [])]
    most = max(loads, key=lambda item: item.load, default=None)
    if most is None or most.load <= 0.0:
        return inf, "no connection carries a load"
    where = f"block {most.block} on block {most.partner}, {number(most.time)} s"
    why = (*_kind(most, place(machine)[most.block]), *_occasion(rollout, trace, machine, most.time))
    return 1.0 / most.load, ", ".join((where, " ".join(why)))


def _kind(load: Peak | Broken, block: Placed) -> Iterator[str]:
    """How it loads the connection: along the block's Front, or the line of a two-ended block."""
    along: Vec3 = block.front if not block.two_ended else (0.0, 0.0, 0.0)
    if block.end_a is not None and block.end_b is not None:
        line = subtract(block.end_b, block.end_a)
        sign = 1.0 if block.step.parent == load.partner else -1.0
        along = scale(line, sign / (length(line) or 1.0))
    values = constants()
    moment = hypot(*load.moment) / values.of("strength_torque", block.type)
    force = hypot(*load.force) / values.of("strength_force", block.type)
    vector = load.moment if moment > force else load.force
    share = dot(vector, along) / (length(vector) or 1.0)
    if moment > force:
        yield "twisting" if abs(share) > ALONG else "bending"
    else:
        yield "shear" if abs(share) <= ALONG else "push" if share > 0 else "pull"


def _occasion(rollout: Rollout, trace: Trace, machine: Machine, time: float) -> Iterator[str]:
    """What happened then: the decisive moment, or the hardest hit of a block."""
    moment, contacts = rollout.feedback.data.get("moment"), trace.measured.contacts
    if moment is not None and abs(moment["time"] - time) <= NEAR:
        yield f"at {moment['name']}"
        return
    hits = [
        each for each in contacts if 0.0 <= time - each.hardest.time <= NEAR and not each.standing
    ]
    if hits:
        hit = max(hits, key=lambda contact: contact.hardest.impulse)
        yield f"when {body_name(machine, hit.a)} hits {body_name(machine, hit.b)}"


def _tilt(_rollout: Rollout, trace: Trace, _machine: Machine) -> tuple[float, str]:
    upright = rotate(trace.rotation[:, 0], (0.0, 1.0, 0.0))[:, 1]
    angles = np.degrees(np.arccos(np.clip(upright, -1.0, 1.0)))
    most = int(angles.argmax())
    return float(angles[most]), f"{number(trace.times[most])} s"


def _broken(rollout: Rollout, _trace: Trace, _machine: Machine) -> tuple[float, str]:
    first = [
        f"first block {item.block} off block {item.partner}, {number(item.time)} s"
        for item in rollout.broken[:1]
    ]
    return float(len(rollout.broken)), "".join(first)


def _drawn(name: str, _: Rollout, trace: Trace, _machine: Machine) -> tuple[float | None, str]:
    drawn = trace.measured.drawn
    if drawn is None:
        return None, "not measured"
    return (drawn.power, f"{number(drawn.time)} s") if name == "power" else (drawn.energy, "")


_READERS: Mapping[str, Callable[[Rollout, Trace, Machine], tuple[float | None, str]]] = {
    "safety": _safety,
    "tilt": _tilt,
    "broken": _broken,
    "power": partial(_drawn, "power"),
    "energy": partial(_drawn, "energy"),
}

"""The data of a machine and its rollout on a page: solids, motion, events."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from agentflow.app.machines.convert import FORMATS, Wishes
from agentflow.env.drawing.film import landing_of, tracked_block
from agentflow.env.drawing.solids import MachineSolids
from agentflow.env.mechanism import classify
from agentflow.env.physics.model import Color
from agentflow.env.query import CONTROLLERS
from agentflow.env.rollout import Broken, Rollout, RolloutEvent, Trace
from agentflow.env.rotations import unify_signs
from agentflow.env.scene import Scene, SceneObject
from agentflow.env.simulation.trials import SHOWN_TRIAL
from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import plate_of
from agentflow.machine.brief import LONE_ROOT
from agentflow.machine.controls import Lane, lanes
from agentflow.machine.geometry.vectors import IDENTITY
from agentflow.machine.tree import Machine
from agentflow.making.guide import bill_csv
from agentflow.report.film import FilmMotion, deflate, pack_motion

GIVEN: tuple[tuple[str, Color], tuple[str, Color]] = (
    ("source", (0.80, 0.33, 0.20, 1.0)),
    ("target", (0.13, 0.50, 0.66, 1.0)),
)
"""Name and colour of given blocks: those with a motor, and the others."""
THINNED = 3
"""Trials other than the one shown first keep one in this many samples."""
MOST_SPANS = 100
"""Most values of a sensor or law that are shown under a film."""
MOST_TRACES = 4
MOST_EVENTS = 40
"""Most events listed for one film."""
Row = list[Any]


class Shapes:
    """What the machines on a page share: distinct solids, and one stream of files to download."""

    def __init__(self) -> None:
        self._known: dict[tuple[Any, ...], int] = {}
        self._files = bytearray()

    @property
    def data(self) -> dict[str, Any]:
        """Both as a page has them, beside its machines.

        The files are one after another, deflated together: similar machines have similar files.
        """
        return {"shapes": self.rows, "files": deflate(bytes(self._files))}

    @property
    def rows(self) -> list[Row]:
        """Every solid in page format, in order of number."""
        return [list(row) for row in self._known]

    def number(self, solid: SceneObject) -> int:
        """The number of a solid given in its block's frame."""
        return self._known.setdefault(tuple(solid_row(solid)), len(self._known))

    def attach(self, content: bytes) -> tuple[int, int]:
        """Add a file; where it begins and ends among them."""
        begin = len(self._files)
        self._files += content
        return begin, len(self._files)


def machine_data(
    machine: Machine,
    rollout: Rollout | None,
    shapes: Shapes,
    remark: str = "",
    *,
    given: Machine = LONE_ROOT,
    played: Sequence[Rollout] = (),
) -> dict[str, Any]:
    """The data of a machine for a page: in motion if there is a trace, else as built.

    Args:
        machine: File-valid.
        rollout: Its rollout; None if it was not simulated.
        shapes: Collects the machine's solids and files.
        remark: Text below the film.
        given: Blocks given by the task, which get special colours.
        played: All trials in order, if each gets a film.
    """
    figures, marks = MachineSolids(machine), _given_marks(given)
    solids = [
        [shapes.number(replace(solid, color=marks.get(block, ("", solid.color))[1])) for solid in s]
        for block, s in enumerate(figures.solids)
    ]
    return {
        "solids": solids,
        "rods": [_rod_data(step.id, machine, figures) for step in machine if step.two_ended],
        "hero": tracked_block(machine),
        "given": [[name, list(color[:3])] for name, color in dict(marks.values()).items()],
        "feedback": rollout.feedback.text if rollout is not None else "",
        "mechanism": _mechanism(machine, rollout),
        "remark": remark,
        "files": _files(machine, shapes),
        "lanes": [*(_lane_data(lane, machine) for lane in lanes(machine)), *_curves(rollout)],
        "trials": _trial_data(machine, figures, rollout, played),
        **_film_data(machine, figures, rollout),
    }


def _lane_data(lane: Lane, machine: Machine) -> dict[str, Any]:
    """The blocks of a lane in words, and its spans, for the timeline under a film."""
    names = sorted({library()[machine[block].type].name for block in lane.blocks})
    noun = "block" if len(lane.blocks) == 1 else "blocks"
    name = f"{noun} {', '.join(map(str, lane.blocks))} ({', '.join(names)})"
    return {"name": name, "spans": [list(span) for span in lane.spans]}


def _curves(rollout: Rollout | None) -> list[dict[str, Any]]:
    """What sensors read and laws gave, as lanes whose levels are shares of the greatest value."""
    told = None if rollout is None else rollout.feedback.data.get(CONTROLLERS)
    if not told:
        return []
    every = len(told["times"]) // MOST_SPANS + 1
    times, found = told["times"][::every], []
    for kind in ("sensors", "laws"):
        for name, values in told[kind].items():
            most = max(map(abs, values)) or 1.0
            target = told["targets"].get(name) if kind == "laws" else None
            aim = "" if target is None else f" (target {target:g})"
            levels = zip(times, [*times[1:], told["times"][-1]], values[::every], strict=True)
            spans = [[begin, end, round(value / most, 3)] for begin, end, value in levels if value]
            label = f"{kind[:-1]} {name}{aim}, as a share of {most:.3g}"
            found.append({"name": label, "spans": spans})
    return found


def _mechanism(machine: Machine, rollout: Rollout | None) -> str | None:
    """The mechanism class; None if the rollout does not show it."""
    found = None if rollout is None else classify(machine, rollout)
    return None if found is None else str(found)


def _files(machine: Machine, shapes: Shapes) -> dict[str, tuple[int, int]]:
    """Name -> place of the files of a machine; plates are not blocks of the game."""
    formats = (".json", ".glb") if plate_of(machine[0].type) else (".json", ".bsg", ".glb")
    name = f"machine-{machine.digest}"
    written = {suffix: FORMATS[suffix].write(machine, Wishes())[0] for suffix in formats}
    written[".csv"] = bill_csv(machine).encode()
    return {f"{name}{suffix}": shapes.attach(data) for suffix, data in written.items()}


def _film_data(
    machine: Machine, figures: MachineSolids, rollout: Rollout | None, every: int = 1
) -> dict[str, Any]:
    """Data of one rollout: scene, motion, events."""
    trace = rollout.trace if rollout is not None else None
    scene = rollout.scene if rollout is not None and rollout.scene is not None else Scene()
    moving = trace.objects if trace is not None else ()
    columns = {name: len(machine) + index for index, name in enumerate(moving)}
    flag = None if rollout is None else landing_of(machine, rollout)
    return {
        "objects": [
            [*solid_row(_in_own_frame(item, columns)), columns.get(item.name)]
            for item in scene.objects
        ],
        "wind": _wind_text(scene),
        "traces": _traces(machine, columns),
        "connections": [block for block, _ in trace.connections] if trace is not None else [],
        "gone": _loss_times(trace, machine) if trace is not None else {},
        "breaks": {item.block: item.time for item in reversed(rollout.broken)} if rollout else {},
        "events": _events(rollout, machine) if rollout is not None else [],
        "film": pack_motion(_motion(figures, trace, machine, every)),
        "flag": flag and asdict(flag),
    }


def _trial_data(
    machine: Machine, figures: MachineSolids, whole: Rollout | None, played: Sequence[Rollout]
) -> list[dict[str, Any]]:
    """Data of every trial, with a film unless it is the one that `whole` shows.

    Empty if a trial did not finish: then `whole` has no outcomes.
    """
    if whole is None or SHOWN_TRIAL not in whole.terms:
        return []
    found = []
    for number, rollout in enumerate(played, start=1):
        shown = number == whole.terms[SHOWN_TRIAL]
        film = {}
        if not shown and rollout.trace is not None:
            film = _film_data(machine, figures, rollout, THINNED)
        entry = {
            "number": number,
            "success": whole.terms[f"trial_{number}"],
            "outcome": whole.terms[f"outcome_{number}"],
            "shown": shown,
        }
        found.append(entry | film)
    return found


def _given_marks(given: Machine) -> dict[int, tuple[str, Color]]:
    """Name and colour of each given block except the root."""
    return {
        step.id: GIVEN[0] if library()[step.type].non_static else GIVEN[1]
        for step in given
        if step.parent >= 0
    }


def _wind_text(scene: Scene) -> str:
    """The wind in words; "" if there is none."""
    parts = [
        f"{abs(speed):g} m/s towards {axis}{'+' if speed > 0 else '-'}"
        for axis, speed in zip("xyz", scene.wind, strict=True)
        if speed
    ]
    return " and ".join(parts) + (", in gusts" if parts and scene.gusts else "")


def _traces(machine: Machine, columns: Mapping[str, int]) -> list[dict[str, Any]]:
    """Bodies whose paths are drawn: the root, the boulder, moving objects of the scene."""
    hero = tracked_block(machine)
    boulder = {"boulder": hero} if hero else {}
    named = {library()[machine[0].type].name: 0, **boulder, **columns}
    return [{"body": body, "name": name} for name, body in named.items()][:MOST_TRACES]


def _motion(
    figures: MachineSolids, trace: Trace | None, machine: Machine, every: int
) -> FilmMotion:
    """Motion of blocks, then of moving objects: every sample, or one in `every` regular ones.

    Two-ended blocks get no motion: they are drawn between their ends.
    """
    if trace is None:
        rest = figures.rest
        return FilmMotion(np.zeros(1), rest.centre[None], rest.rotation[None], np.zeros((1, 0)))
    if every > 1:
        trace = trace.even[::every]
    position = np.concatenate([trace.centre, trace.object_position], axis=1)
    rotation = np.concatenate([trace.rotation, trace.object_rotation], axis=1)
    for step in machine:
        if step.two_ended:
            position[:, step.id] = position[:, 0]
            rotation[:, step.id] = IDENTITY
    return FilmMotion(trace.times, position, unify_signs(rotation), trace.utilisation)


def solid_row(solid: SceneObject) -> Row:
    """Kind, size, position, rotation and colour of a solid."""
    size = (solid.size[0],) * 3 if solid.shape == "sphere" else solid.size
    numbers = (*size, *solid.position, *solid.rotation, *solid.color[:3])
    return [solid.shape, *(round(float(value), 4) + 0.0 for value in numbers)]


def _in_own_frame(item: SceneObject, columns: dict[str, int]) -> SceneObject:
    """An object, in its own frame if it moves."""
    if item.name not in columns:
        return item
    return SceneObject(item.name, item.shape, item.size, (0.0, 0.0, 0.0), color=item.color)


def _rod_data(block: int, machine: Machine, figures: MachineSolids) -> dict[str, Any]:
    ends = zip(machine[block].parents, figures.ends[block], strict=True)
    return {
        "block": block,
        "color": list(figures.rod(block, figures.rest).color[:3]),
        "ends": [[parent, *(round(float(value), 4) for value in end)] for parent, end in ends],
    }


def _loss_times(trace: Trace, machine: Machine) -> dict[int, float]:
    """Two-ended block -> time at which it broke off."""
    lost = {step.id: np.flatnonzero(~trace.alive[:, step.id]) for step in machine if step.two_ended}
    return {block: float(trace.times[at[0]]) for block, at in lost.items() if len(at)}


def _events(rollout: Rollout, machine: Machine) -> list[dict[str, Any]]:
    """Breaks and other events, in order of time."""
    found = [
        {"time": item.time, "kind": "broke", "text": _break_text(item, machine)}
        for item in rollout.broken
    ]
    found += [
        {"time": item.time, "kind": "told", "text": _event_text(item)} for item in rollout.events
    ]
    return sorted(found, key=lambda item: float(str(item["time"])))[:MOST_EVENTS]


def _event_text(event: RolloutEvent) -> str:
    """An event in words. The text of a stalled motor only names the motor."""
    text = event.text or event.kind.replace("_", " ")
    return f"motor stalled: {text}" if event.kind == "motor_stalled" else text


def _break_text(item: Broken, machine: Machine) -> str:
    name, partner = _block_name(item.block, machine), _block_name(item.partner, machine)
    return f"{name} broke off {partner} at load {item.load:.2f}"


def _block_name(block: int, machine: Machine) -> str:
    return f"block {block} ({library()[machine[block].type].name})"

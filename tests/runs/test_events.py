"""Every kind of event: to its line and back, damaged, and unknown."""

from __future__ import annotations

import json
import random
import shutil
import typing
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields, is_dataclass, replace
from pathlib import Path
from types import NoneType, UnionType
from typing import Any

import pytest

from agentflow.app.design.run import rationales_of
from agentflow.app.inspect.failures import count_failures
from agentflow.app.inspect.overview import run_details
from agentflow.app.subjects.verify import rescore
from agentflow.errors import RunError
from agentflow.report.run import RunStory
from agentflow.runs import Event, RunDirectory, read_events
from agentflow.runs.events import EvaluationEvent, RunEvent, read_typed_events, typed_event
from agentflow.runs.locations import Location
from agentflow.runs.record import RunRecord

RECORDED = Path(__file__).parents[2] / "runs" / "recorded-throwing"
KINDS = sorted(RunEvent.kinds)
TEXTS = ("", "a/b", "x\n[bold]", "\u202e\0", "\ud800", "traj-1")
"""Texts as models write them, a lone surrogate among them."""


def some(hint: Any, chance: random.Random) -> Any:
    """A random value of a type."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, UnionType):
        return some(chance.choice(args), chance)
    if origin is tuple:
        parts = [args[0]] * chance.randrange(4) if args[-1] is Ellipsis else args
        return tuple(some(part, chance) for part in parts)
    if origin is Mapping and args != (str, Any):
        return {text: some(args[1], chance) for text in "ab"}
    if hint is Location:
        return Location(chance.choice(["", "initial", "refiner/blind"]), **_numbers(chance))
    if is_dataclass(hint):
        return _made(hint, chance)
    values: dict[Any, Callable[[], Any]] = {
        str: lambda: chance.choice(TEXTS),
        bool: lambda: chance.random() < 0.5,
        int: lambda: chance.randrange(-3, 10**6),
        float: lambda: chance.choice([0.0, -1.5, 1e300, chance.random()]),
        NoneType: lambda: None,
    }
    return values.get(origin or hint, lambda: _json(hint, chance))()


def _json(hint: Any, chance: random.Random) -> Any:
    items = [chance.choice(TEXTS), chance.randrange(9), None, {"a": [1.5]}]
    if "Sequence" in str(hint):
        return [{"blocks": [1], "text": chance.choice(TEXTS)}] * chance.randrange(3)
    return dict(zip("abcd", items, strict=True))


def _numbers(chance: random.Random) -> dict[str, int]:
    names = [field.name for field in fields(Location) if field.name != "name"]
    return {name: chance.randrange(name != "node", 30) for name in names if chance.random() < 0.5}


def _made(cls: Any, chance: random.Random) -> Any:
    hints = typing.get_type_hints(cls)
    made = cls(**{f.name: some(hints[f.name], chance) for f in fields(cls) if f.name != "at"})
    if isinstance(made, RunEvent):
        needed = {part: chance.randrange(1, 30) for part in made.needs}
        made = replace(made, location=replace(made.location, **needed))
    return made


def test_a_kind_cannot_be_declared_twice() -> None:
    owner = r"'edit' is already used by agentflow\.runs\.events\.EditEvent"
    with pytest.raises(ValueError, match=owner):

        class Edit(RunEvent, kind="edit"):
            """An event of a plugin."""

    assert RunEvent.kinds["edit"].__module__ == "agentflow.runs.events"


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_is_read(kind: str, tmp_path: Path) -> None:
    chance = random.Random(kind)
    made = {(e.kind, e.label): e for e in (_made(RunEvent.kinds[kind], chance) for _ in range(100))}
    run = RunDirectory.create(tmp_path, "run", {})
    for event in made.values():
        run.event(event)
    run.close()
    assert list(read_typed_events(run.path)) == list(made.values())
    recorded = [(event.kind, event.label, event.data) for event in read_events(run.path)]
    assert recorded == [(e.kind, e.label, json.loads(json.dumps(e.data))) for e in made.values()]


def test_recorded_events_are_written_as_they_were() -> None:
    events = list(read_events(RECORDED))
    again = [typed_event(event) for event in events]
    assert all(isinstance(event, RunEvent) for event in again)
    lines = [json.dumps([event.kind, event.label, event.at, event.data]) for event in events]
    assert [json.dumps([e.kind, e.label, e.at, e.data]) for e in again] == lines


@pytest.mark.parametrize(
    ("label", "location"),
    [
        ("initial", Location("initial")),
        ("structure-2", Location(structure=2)),
        ("env_feedback/traj-1/node-0", Location("env_feedback", trajectory=1, node=0)),
        (
            "designer/structure-1/traj-2/candidate-3/attempt-4",
            Location("designer", structure=1, trajectory=2, candidate=3, attempt=4),
        ),
        (
            "refiner/feedback/traj-1/round-2/node-0/try-3/attempt-1",
            Location("refiner/feedback", trajectory=1, round=2, node=0, try_=3, attempt=1),
        ),
        ("round-1/node-0/try-1", Location(round=1, node=0, try_=1)),
        ("somebody/else", Location("somebody/else")),
        ("attempt-1/traj-2", Location("attempt-1", trajectory=2)),
    ],
)
def test_a_label_names_a_location(label: str, location: Location) -> None:
    assert (Location.parse(label), str(location)) == (location, label)


def test_pages_show_a_label_in_words() -> None:
    told = {
        "refiner/traj-1/round-2/node-0/try-1/attempt-1": "refiner, design 1, round 2",
        "designer/structure-1/traj-2/attempt-3": "designer, structure 1, design 2, attempt 3",
        "env_feedback/call-4": "refinement with feedback, call 4",
    }
    assert {label: Location.parse(label).words for label in told} == told


def test_any_label_is_read_and_written_alike() -> None:
    chance = random.Random(1)
    parts = ["traj-1", "traj-01", "traj-0", "node-0", "try-٣", "round-9999999999", "a", "", "\n"]
    for _ in range(2000):
        label = "/".join(chance.choices(parts, k=chance.randrange(5)))
        assert str(Location.parse(label)) == label
        location = some(Location, chance)
        assert Location.parse(str(location)) == location


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_data_are_named(kind: str) -> None:
    cls = RunEvent.kinds[kind]
    made = _made(cls, random.Random(2))
    for field in fields(cls):
        if field.name == "location" or {field.default, field.default_factory} != {MISSING}:
            continue
        rest = {key: value for key, value in made.data.items() if key != field.name}
        with pytest.raises(ValueError, match=rf"^{kind} .*: {field.name}: Field required"):
            typed_event(Event(kind, made.label, rest))
        if field.type != "Any":
            with pytest.raises(ValueError, match=rf"^{kind} .*: {field.name}[.:]"):
                typed_event(Event(kind, made.label, {**rest, field.name: object()}))
    if cls.needs:
        with pytest.raises(ValueError, match=f"the label of {kind} 'x' has no {cls.needs[0]}"):
            typed_event(Event(kind, "x", made.data))


READERS: dict[str, Callable[[Path], object]] = {
    "show": run_details,
    "failures": count_failures,
    "rescore": lambda run: rescore(run, workers=1),
    "report": lambda run: RunStory.read(run, None, None),
    "rationales": rationales_of,
    "record": lambda run: RunRecord.of(read_typed_events(run)),
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize(
    ("damage", "why"),
    [
        ({"data": None}, ""),
        ({"data": {}}, ": evaluation .*: machine: Field required"),
        ({"score": "high"}, ": evaluation .*: score: Input should be a valid number.*"),
        ({"label": "initial"}, ": the label of evaluation 'initial' has no trajectory"),
    ],
    ids=["no object", "no data", "no number", "no location"],
)
def test_every_reader_names_the_damaged_line(
    reader: str, damage: dict[str, Any], why: str, tmp_path: Path
) -> None:
    run = shutil.copytree(RECORDED, tmp_path / "run")
    file = run / "events.jsonl"
    lines = file.read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if json.loads(line)["kind"] == EvaluationEvent.kind)
    event = json.loads(lines[at])
    lines[at] = json.dumps({**event, "data": {**event["data"], **damage}, **damage})
    file.write_text("".join(line + "\n" for line in lines))
    location = str(file).replace(".", r"\.")
    with pytest.raises(RunError, match=rf"^{location} is damaged in line {at + 1}{why}$"):
        READERS[reader](run)


def test_unknown_kinds_and_unknown_data_change_nothing(tmp_path: Path) -> None:
    run = shutil.copytree(RECORDED, tmp_path / "run")
    lines = [json.loads(line) for line in (run / "events.jsonl").read_text().splitlines()]
    unknown = {"kind": "tomorrow", "label": "a/b", "at": 0.5, "data": {"machine": 7}}
    events = [{**line, "data": {**line["data"], "new": 1}} for line in lines]
    text = "".join(
        f"{json.dumps(e)}\n{json.dumps({**unknown, 'label': str(i)})}\n"
        for i, e in enumerate(events)
    )
    (run / "events.jsonl").write_text(text)
    kept = [event for event in read_typed_events(run) if isinstance(event, Event)]
    assert kept[0] == Event("tomorrow", "0", {"machine": 7})
    assert len(kept) == len(lines)
    same = {"show": run_details, "failures": count_failures, "rationales": rationales_of}
    for name, read in same.items():
        found, expected = read(run), read(RECORDED)
        if name == "show":
            found["run"] = expected["run"]
        assert found == expected
    assert RunStory.read(run, None, None).nodes == RunStory.read(RECORDED, None, None).nodes

"""Records: each is a valid machine within its budget that has the scores of its file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from agentflow.app.tasks import list_tasks, task_json
from agentflow.cli.display.show_scores import record_line
from agentflow.env.physics.registry import ENGINES
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.records import (
    SCORES,
    full_score,
    read_records,
    record_json,
    record_of,
    record_share,
    scores_file,
)
from agentflow.env.tasks.registry import FAMILIES, get_level, get_task, make_task, task_names
from agentflow.env.verification import verify
from agentflow.machine.validity import check
from benchmarks.shelf import DIGITS, MachineRecord, here, machine_records, read_record, scores_text
from tests.loops import for_each

ELSEWHERE = 0.05
"""How far a score may be off on another platform."""
LEAST = 0.2
"""Least share of the record that is good: less would soon be reached by first machines."""
HOW = (
    "reference ",
    "hill climbing from ",
    "by hand",
    "strong language model",
    "procedur",
)
RECORDS = machine_records()


@for_each(RECORDS)
def test_a_record_names_the_engine_of_its_scores(name: str) -> None:
    engine, _, version = RECORDS[name].engine.partition(" ")
    assert engine in ENGINES
    assert version[0].isdigit()


def test_a_share_on_another_engine_says_whose_record_it_is() -> None:
    found = record_of(get_task("throwing"))
    assert found is not None
    made = found.engine.partition(" ")[0]
    for engine in ENGINES:
        other = read_records(engine).get("throwing-1")
        told = record_json(make_task(get_level("throwing"), {}, engine), (other or found).verified)
        assert told is not None
        assert (told["share"], told["engine"]) == (1.0, (other or found).engine)
        own = engine == made or other is not None
        assert told["of"] == ("record" if own else f"record of {found.engine}")
        lost = record_of(make_task(get_level("throwing"), {"wall.height": 1.6}, engine))
        assert lost is None


@for_each(RECORDS)
def test_a_record_is_a_valid_machine_within_its_budget(name: str) -> None:
    record = RECORDS[name]
    task = get_task(record.task, record.knobs)
    report = check(record.machine, task.brief)
    assert report.task_valid, report.problems
    assert record_of(task) == read_records()[name]
    assert record.low <= record.verified
    assert record.how.startswith(HOW)
    levels = {f"{task.family}-{task.level}"}
    assert name in levels if not record.knobs else name not in levels


@for_each(task_names())
def test_every_level_has_a_record_that_is_good(level: str) -> None:
    record, good = record_of(get_task(level)), get_level(level).file.good
    assert record is not None
    assert record.verified >= good >= LEAST * record.verified


@pytest.mark.parametrize("level", ["bridge/3", "bridge/4", "bridge/5"])
def test_the_best_known_bridges_do_not_carry_the_whole_load(level: str) -> None:
    record, task = record_of(get_task(level)), get_task(level)
    assert record is not None
    assert task.brief.greatest is not None
    assert record.score < 0.8 * task.brief.greatest


def keeps(record: MachineRecord, then: list[float], now: list[float | None]) -> None:
    found = [round(score or 0.0, DIGITS) for score in now]
    assert found == (then if record.platform == here() else pytest.approx(then, rel=ELSEWHERE))


OTHERS = [(spec.name, name) for spec in ENGINES.values() for name in machine_records(spec.name)]
"""Records of other engines than that of `RECORDS`."""


@for_each(OTHERS)
def test_another_engine_has_valid_records_of_its_own(engine: str, name: str) -> None:
    record = machine_records(engine)[name]
    task = make_task(get_level(record.task), record.knobs, engine)
    assert check(record.machine, task.brief).task_valid
    assert (record.engine.partition(" ")[0], record.how.startswith(HOW)) == (engine, True)
    found = record_of(task)
    assert found == read_records(engine)[name]
    assert found.name == f"{engine}/{name}"
    assert record.low <= record.verified
    assert (record.task, record.knobs) == (RECORDS[name].task, RECORDS[name].knobs)


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "name"), OTHERS)
def test_a_record_of_another_engine_keeps_its_score(engine: str, name: str) -> None:
    record = machine_records(engine)[name]
    task = make_task(get_level(record.task), record.knobs, engine)
    found = simulate(record.machine, task, seed=record.seed).score
    then = (
        record.score if record.platform == here(engine) else pytest.approx(record.score, rel=0.05)
    )
    assert round(found or 0.0, DIGITS) == then


SAMPLE = (
    *("bridge-3", "delivery-heavy-cargo", "flying-tilted", "gearing-1", "lifting-3"),
    *("movement-2", "picking-4", "rocket-1", "throwing-few-blocks", "transport-1"),
)
"""The quickest of each family to verify, which takes ten rollouts; `benchmarks/records.py update`
verifies all. Those of jumping have ten trials each, as this one of lifting has."""


def test_the_sample_has_every_other_family() -> None:
    assert {RECORDS[name].task.partition("/")[0] for name in SAMPLE} == {*FAMILIES} - {"jumping"}


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in RECORDS if name not in SAMPLE])
def test_a_record_keeps_its_score(name: str) -> None:
    record = RECORDS[name]
    task = get_task(record.task, record.knobs)
    keeps(record, [record.score], [simulate(record.machine, task, seed=record.seed).score])


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLE)
def test_a_record_keeps_its_verified_scores(name: str) -> None:
    record = RECORDS[name]
    found = verify(record.machine, get_task(record.task, record.knobs), seed=record.seed)
    now = [found.default.score, found.score, found.low]
    keeps(record, [record.score, record.verified, record.low], now)


def test_knobs_are_compared_by_value() -> None:
    """A record counts for its level however its knobs are written, and for no other knobs."""
    record = record_of(get_task("throwing"))
    assert record is not None
    assert record_of(get_task("throwing/1", {"wall.height": "1.5"})) == record
    assert record_of(get_task("throwing", {"wall": {"height": 1.5}})) == record
    assert record_of(get_task("throwing", {"wall.height": 1.6})) is None
    assert record_share(get_task("throwing", {"wall.height": 1.6}), 1.0) is None


def test_the_share_is_that_of_the_verified_score() -> None:
    task = get_task("throwing")
    record = record_of(task)
    assert record is not None
    assert record_share(task, record.verified / 2) == 0.5
    assert record_share(task, None) is None
    found = record_json(task, record.verified / 4)
    assert found is not None
    assert (found["share"], found["blocks"]) == (0.25, record.size)


def test_the_greatest_possible_score_takes_the_place_of_the_record() -> None:
    assert full_score(get_task("flying/5")) == 30.0
    assert record_share(get_task("lifting", {"wind.speed": 1}), 7.0) == 0.7
    found = record_json(get_task("bridge"), 1500.0)
    assert found is not None
    assert (found["share"], found["full"]) == (0.25, 6000.0)
    told = "25% of the greatest possible score, 6000.00; record: 4800.00 (verified, "
    assert record_line(found).startswith(told)


def test_lists_of_tasks_show_records() -> None:
    (first,) = (item for item in list_tasks() if item["name"] == "throwing")
    assert first["record"] == task_json("throwing")["record"] == record_json(get_task("throwing"))
    assert task_json("throwing", ["wind.speed=1"])["record"] is None
    for told in (first, task_json("throwing")):
        assert ".json" not in json.dumps(told), "agents that design read where a solution is"


def test_types_can_be_withheld() -> None:
    """The reference of throwing needs springs; without them it is refused."""
    task = get_task("throwing", {"blocks.without": [9]})
    assert 9 not in task.brief.blocks
    assert simulate(RECORDS["throwing-1"].machine, task).status == "invalid"
    assert not any("pring" in sentence for sentence in task.brief.schedule[1:])


def test_the_package_knows_the_scores_of_the_machines() -> None:
    """If this fails: python benchmarks/records.py scores."""
    for engine in ("", *{engine for engine, _ in OTHERS}):
        assert scores_text(engine) == scores_file(engine).read_text(encoding="utf-8")
    assert "parent" not in SCORES.read_text(encoding="utf-8")


def test_records_keep_control_programs(tmp_path: Path) -> None:
    name, first = "movement-1", RECORDS["movement-1"]
    controls = ({"group": "motors", "at": 0, "for": 1, "level": 1},)
    file = tmp_path / f"{name}.json"
    file.write_text(first.model_copy(update={"controls": controls}).to_text())
    assert read_record(file).controls == controls
    assert '"controls"' not in first.to_text(), name

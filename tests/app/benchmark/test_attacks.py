"""Attackers: whoever wants a high place without designing machines fails, or is named."""

from __future__ import annotations

import asyncio
import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import pytest

from agentflow.api import design_prompt
from agentflow.app.benchmark import check as checking
from agentflow.app.benchmark import run as carried_out
from agentflow.app.benchmark.card import (
    CountedMachine,
    ItemResult,
    Scorecard,
    read_card,
    summary,
    write_card,
)
from agentflow.app.benchmark.check import _like, check_cards
from agentflow.app.benchmark.plan import conditions, plan_benchmark, read_items
from agentflow.app.benchmark.run import make_card
from agentflow.app.sweeps.tables import read_sweep_result
from agentflow.cli import main
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.variations import DEFAULT, Variation
from agentflow.env.tasks import records
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import FAMILIES, get_task
from agentflow.env.verification import verify_async
from agentflow.errors import AgentflowError, RunError
from agentflow.files.documents import sealed
from agentflow.machine import Machine
from agentflow.progress import silent
from benchmarks.shelf import machine_records
from tests.app.benchmark.boards import SMALL, write
from tests.tools.benches import CAR, open_bench

ROOT = Path(__file__).parents[3]
SHIPPED = ROOT / "docs" / "cards"
RECORDS = machine_records()
THROW = {**SMALL["axes"], "task": {"few": {"task": "throwing", "blocks.max": 20}}}


def check(path: Path, source: Path, tolerance: float = 0.0) -> tuple[str, ...]:
    return check_cards([path], source, tolerance=tolerance, workers=1, say=silent)


@cache
def known(machine: Machine, task: Task, seed: int, variation: Variation) -> Rollout:
    return simulate(machine, task, seed=seed, variation=variation)


class Here:
    """A pool that simulates in this process, everything once."""

    def __init__(self, _workers: int = 1) -> None: ...

    async def __aenter__(self) -> Here:
        return self

    async def __aexit__(self, *_: object) -> None: ...

    async def run(
        self, machine: Machine, task: Task, *, seed: int = 0, variation: Variation = DEFAULT
    ) -> Rollout:
        return known(machine, task, seed, variation)


@pytest.fixture(autouse=True)
def _in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checking, "RolloutPool", Here)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a small benchmark, its file and its card."""
    folder = tmp_path_factory.mktemp("attacked")
    assert main(["benchmark", str(write(folder)), "--out", str(folder), "--quiet"]) == 0
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return shutil.copytree(made, tmp_path / "made")


def answered(source: Path, machine: Machine) -> Scorecard:
    """The card of a model that answers with one machine, whatever it is asked."""
    plan = plan_benchmark(source, (), {})
    (name, item), *_ = read_items(plan.sweep).items()
    engine = plan.runs[0].config.engine
    task = replace(item.task, engine=engine)
    found = asyncio.run(verify_async(machine, task, partial(Here().run, machine, task)))
    text = json.dumps(machine.to_json())

    def counted(score: float | None, fragile: bool | None) -> CountedMachine:
        assert score is not None
        score, share = round(score, 6), item.share(score)
        return CountedMachine(
            outcome="scored", score=score, share=share, fragile=fragile, machine=text
        )

    assert found.holding is not None
    first = counted(found.default.score, None)
    results = (
        ItemResult(
            item=name,
            family=item.task.family,
            task=item.task.name,
            knobs=item.knobs,
            full=item.par.par,
            parts={
                "first": (first, first),
                "refined": (counted(found.score, found.holding.fragile),),
            },
        ),
    )
    return Scorecard(
        agentflow="0",
        conditions=conditions(plan.sweep),
        digest="0",
        model="copier",
        sampling={},
        made="2026-01-01",
        complete=True,
        total=summary(results),
        families={item.task.family: summary(results)},
        items=results,
        cost={"calls": 0, "prompt_tokens": 0, "completion_tokens": 0, "money": 0, "rollouts": 0},
    )


@pytest.mark.slow
def test_an_honest_card_has_its_scores(folder: Path) -> None:
    told = check(folder / "small", folder / "small.yaml")
    assert told[0].startswith("procedural (no language model): 6 machines have their scores on")
    (alone, *_) = check(folder / "small" / "card.json", folder / "small.yaml")
    assert alone.endswith("its costs are not checked, because its runs are not here.")


def test_cards_without_machines_are_read_and_not_checkable(tmp_path: Path) -> None:
    card = read_card(SHIPPED / "procedural.json")
    best = card.items[0].parts["search"][0].model_copy(update={"machine": ""})
    bare = {"parts": {"first": (), "search": (best,)}}
    old = card.model_copy(update={"items": (card.items[0].model_copy(update=bare),)})
    write_card(tmp_path / "card.json", old)
    (told,) = check(tmp_path / "card.json", ROOT / "configs" / "benchmark.yaml")
    assert "not checkable: the card holds no machines" in told


def higher(content: dict[str, Any]) -> None:
    content["items"][0]["parts"]["refined"][0].update(score=2.0, share=2.0)


def fuller(content: dict[str, Any]) -> None:
    content["items"][0]["full"] = 0.5


def shorter(content: dict[str, Any]) -> None:
    del content["items"][0]["parts"]["first"][0]


def empty(content: dict[str, Any]) -> None:
    content["items"][0]["parts"]["refined"][0]["machine"] = ""


def excused(content: dict[str, Any]) -> None:
    content["items"][0]["parts"]["refined"][0].update(outcome="invalid", share=1.0)


def total(content: dict[str, Any]) -> None:
    content["total"]["refined"]["mean"] = 3.0


def family(content: dict[str, Any]) -> None:
    content["families"]["gearing"]["first"]["mean"] = 3.0


def swapped(content: dict[str, Any]) -> None:
    content["items"][0]["parts"]["refined"][0]["machine"] = content["items"][1]["parts"]["refined"][
        0
    ]["machine"]


def sturdy(content: dict[str, Any]) -> None:
    content["items"][0]["parts"]["refined"][0]["fragile"] = True


FORGED: dict[Callable[[dict[str, Any]], None], str] = {
    higher: "gearing-1, refined states the score 2 and the share 2.0, but has 1 and 1.0",
    fuller: "its items are not those of",
    shorter: "gearing-1 has 1 machines of first in place of 2",
    empty: "gearing-1, refined has a score and no machine",
    excused: "gearing-1, refined states a score without one",
    total: "its total is not that of its items",
    family: "the mean of gearing is not that of its items",
    swapped: "gearing-1, refined states the score 1 and the share 1.0, but has 0 and 0.0",
    sturdy: "gearing-1, refined states another fragility",
}


@pytest.mark.slow
def test_forged_cards_are_refused(folder: Path) -> None:
    """Their seals are right: whoever edits a card can seal it."""
    file = folder / "small" / "card.json"
    honest = file.read_text()
    for forge, message in FORGED.items():
        content = json.loads(honest)
        forge(content)
        file.write_text(json.dumps(sealed(content)))
        with pytest.raises(RunError) as caught:
            check(file, folder / "small.yaml")
        assert f"states what is not so: {message}" in str(caught.value), forge


@pytest.mark.slow
def test_cards_of_an_easier_benchmark_are_refused(folder: Path, tmp_path: Path) -> None:
    other = write(tmp_path, benchmark={**SMALL["benchmark"], "lowest": ["gearing-1"]})
    with pytest.raises(AgentflowError, match=r"cannot be checked with .*: its plan is "):
        check(folder / "small" / "card.json", other)


@pytest.mark.slow
def test_a_patched_package_makes_cards_that_are_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As by a program that has written into site-packages."""
    given = carried_out._attempt
    with monkeypatch.context() as patched:
        patched.setattr(
            carried_out, "_attempt", lambda m, s, _, full, f=None: given(m, s, 9.0, full, f)
        )
        write_card(folder / "small" / "card.json", make_card(read_sweep_result(folder / "small")))
    with pytest.raises(
        RunError, match=r"states the score 9 and the share 1\.5, but has 1 and 1\.0"
    ):
        check(folder / "small" / "card.json", folder / "small.yaml")


@pytest.mark.slow
def test_writing_into_runs_is_seen(folder: Path) -> None:
    """A better result, fewer simulations, another machine under the name of the best one."""
    run = folder / "small" / "runs" / "refined.gearing-1.seed-0"
    result = json.loads((run / "result.json").read_text())
    (run / "result.json").write_text(json.dumps({**result, "rollouts": 1}))
    with pytest.raises(RunError, match=r"simulated machines: \d, states 1, and"):
        check(folder / "small", folder / "small.yaml")
    (run / "result.json").write_text(json.dumps(result))
    first = folder / "small" / "runs" / "first.gearing-1.seed-0" / "machines"
    for file in first.glob("*.json"):
        file.write_text(RECORDS["gearing-2"].machine.to_text())
    with pytest.raises(AgentflowError, match="its machine does not match its name"):
        check(folder / "small", folder / "small.yaml")


@pytest.mark.slow
def test_a_record_with_one_block_moved_is_named(tmp_path: Path) -> None:
    pars = {"few": {"floor": 0.0, "par": 90.0}}
    source = write(tmp_path, axes=THROW, benchmark={"version": 2, "pars": pars})
    copied = moved(RECORDS["throwing-few-blocks"].machine)
    write_card(tmp_path / "card.json", answered(source, copied))
    (tmp_path / "machines").mkdir()
    (tmp_path / "machines" / "few.json").write_text(copied.to_text())
    told = "\n".join(check(tmp_path / "card.json", source))
    assert "COPY? copier: few, first is" in told
    assert "edits from the record throwing-few-blocks." in told
    assert "COPY? copier: few, refined is no edits from the par few." in told


def test_an_installed_package_knows_records_that_it_does_not_hold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the hash of their trees; it has no machine to read."""
    monkeypatch.setattr(records, "MACHINES", tmp_path)
    assert {records.record_machine(name) for name in records.read_records()} == {None}
    record = RECORDS["throwing-few-blocks"].machine
    assert list(_like(record, {})) == [("the record throwing-few-blocks", 0)]


async def test_a_check_that_a_busy_computer_cut_short_does_not_call_a_card_wrong(
    tmp_path: Path,
) -> None:
    source = write(tmp_path)
    plan = plan_benchmark(source, (), {})
    (item, *_) = read_items(plan.sweep).values()
    machine = RECORDS["gearing-1"].machine
    stated = CountedMachine(outcome="scored", score=1.0, share=1.0, machine=machine.to_text())
    attempt = checking._Attempt("x", stated, machine, "first", item, plan.runs[0].config)

    class Busy(Here):
        async def run(self, *given: Any, **more: Any) -> Rollout:
            return replace(await super().run(*given, **more), status="timeout", score=None)

    assert "did not end with one here: check again" in await attempt.again(Busy(), 0.0)
    assert await attempt.again(Here(), 0.0) == ""


def moved(machine: Machine) -> Machine:
    """The machine with one block on another face where it still scores."""
    task = get_task("throwing", {"blocks.max": 20})
    for step in reversed(machine.steps):
        for face in range(6):
            steps = [replace(s, face_id=face) if s == step else s for s in machine.steps]
            other = Machine(tuple(steps), machine.controls, machine.controllers)
            if other != machine and simulate(other, task).score:
                return other
    raise AssertionError("no block can be moved")


async def test_parallel_calls_get_no_more_simulations_than_the_budget() -> None:
    async with open_bench(rollouts=1) as (bench, _):
        car = json.loads(CAR)
        names = []
        for count in (len(car), len(car) - 1, len(car) - 2):
            checked = await bench.call("check", {"machine": car[:count]})
            names.append(checked.data["machine"])
        calls = [bench.call("simulate", {"machine": name}) for name in names]
        told = await asyncio.gather(*calls)
    assert [found.refused for found in told].count(False) == 1


@pytest.mark.parametrize("name", ["throwing-1", "records/throwing-1", str(ROOT / "records")])
async def test_tools_tell_nothing_of_records(name: str) -> None:
    async with open_bench("throwing") as (bench, _):
        asked = [{"target": 1, "from": 0, "to": 1, "properties": ["position"]}]
        for tool, more in (("query", {"queries": asked}), ("check", {}), ("simulate", {})):
            told = await bench.call(tool, {"machine": name, **more})
            assert told.refused
            assert RECORDS["throwing-1"].machine.to_text()[-60:] not in told.text


@pytest.mark.parametrize("family", list(FAMILIES))
def test_prompts_show_no_machine_that_could_be_copied(family: str) -> None:
    """They show single blocks, and what a task begins with: nothing is on another block."""
    asked = "\n".join(message["content"] for message in design_prompt(family))
    assert '"parent"' in asked
    assert not re.search(r'"parent": *[1-9]', asked)

"""Paraphrases of briefs and machines of the evaluation are found; our objectives are neither."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from agentflow.api import design_prompt
from agentflow.app.prompts import render_prompt
from agentflow.diversity.topology import tree_hash
from agentflow.env.physics.registry import ENGINES
from agentflow.env.tasks.registry import task_names
from agentflow.errors import RunError
from agentflow.machine import Machine, read_machine
from agentflow.machine.tree import ROOT, Step
from agentflow.training.data.contamination import compare_texts, evaluation_trees
from agentflow.training.evaluation.replies import JudgedReply
from agentflow.training.objectives.objective import read_objectives
from benchmarks.shelf import machine_records

pytest.importorskip("sklearn")
ROOT_FOLDER = Path(__file__).parents[3]
RECORDED = ROOT_FOLDER / "runs" / "recorded-throwing"
PARAPHRASES = {
    "throwing": "A machine which throws its boulder along z+ as far as it possibly can.",
    "throwing/2": "Construct a device that hurls the boulder as far as possible towards z+.",
    "movement": "Create a vehicle whose Starting Block is driven as far as it can go along z+.",
    "lifting": "A machine has to lift an object that is placed on it and keep it up in the air.",
    "jumping": "Design a machine to jump over an obstacle ahead and land beyond it.",
    "picking": "A crane lifts the ball out of a pit and then carries it away.",
    "flying": "A machine that flies as high as it possibly can.",
    "throwing/5": "Throw the boulder through the rings.",
}


def test_paraphrases_of_briefs_are_found() -> None:
    found = compare_texts(PARAPHRASES)
    missed = {name: likeness for name, likeness in found.items() if not likeness.contaminated}
    assert not missed
    families = {name: found[name].level.partition("/")[0] for name in PARAPHRASES}
    assert families == {name: name.partition("/")[0] for name in PARAPHRASES}


def test_a_repeated_sentence_is_found_by_its_words() -> None:
    text = "Once upon a time somebody wished for it: a machine that flies as high as possible."
    likeness = compare_texts({"copy": text})["copy"]  # five of the objective's six runs of words
    assert likeness.level.startswith("flying")
    assert likeness.shared == pytest.approx(5 / 6, abs=1e-4)


@pytest.mark.slow
def test_prompts_of_levels_are_found_and_those_of_our_objectives_are_not() -> None:
    levels = {name: design_prompt(name)[1]["content"] for name in task_names()[::7]}
    found = compare_texts(levels)
    assert [name for name in levels if not found[name].contaminated] == []
    objectives = read_objectives(ROOT_FOLDER / "configs" / "objectives.yaml")[::19]
    own = {item.name: render_prompt("default", "designer", item.task.brief) for item in objectives}
    others = compare_texts({name: f"{p['system']}\n{p['user']}" for name, p in own.items()})
    assert [name for name, likeness in others.items() if likeness.contaminated] == []


@pytest.mark.slow
def test_the_shipped_objectives_are_not_contaminated() -> None:
    objectives = read_objectives(ROOT_FOLDER / "configs" / "objectives.yaml")
    found = compare_texts({item.name: item.text for item in objectives})
    assert [name for name, likeness in found.items() if likeness.contaminated] == []


def test_strange_texts_are_compared() -> None:
    found = compare_texts({"empty": "", "one": "x", "symbols": "⛏ «»", "long": "word " * 5000})
    assert not any(likeness.contaminated for likeness in found.values())


def test_machines_of_runs_and_records_are_known(tmp_path: Path) -> None:
    trees = evaluation_trees([])
    known = [one for engine in ("", *ENGINES) for one in machine_records(engine).values()]
    assert {tree_hash(record.machine) for record in known} == trees
    file = next((RECORDED / "machines").glob("*.json"))
    shutil.copytree(RECORDED, tmp_path / "sweep" / "runs" / "one")
    machine = read_machine(file.read_text()).machine
    assert machine is not None
    assert tree_hash(machine) in evaluation_trees([tmp_path / "sweep"]) - trees


def test_machines_of_evaluations_are_known(tmp_path: Path) -> None:
    machine = Machine((ROOT, *(Step(n, 15, n - 1, 0) for n in range(1, 9))))
    reply = JudgedReply(
        task="movement", seed=0, text="", parsed=True, spatial=True, valid=True, status="ok",
        score=1.0, machine=machine.to_json(),
    )  # fmt: skip
    nothing = reply.model_copy(update={"machine": None})
    for name in ("drives", "begun"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "evaluation.json").write_text("{}")
    lines = "".join(f"{item.model_dump_json()}\n" for item in (nothing, reply))
    (tmp_path / "drives" / "samples.jsonl").write_text(lines)
    assert evaluation_trees([tmp_path]) - evaluation_trees([]) == {tree_hash(machine)}


def test_equal_trees_have_equal_hashes() -> None:
    first = Machine((ROOT, Step(1, 15, 0, 0), Step(2, 2, 0, 3)))
    renumbered = Machine((ROOT, Step(1, 2, 0, 3), Step(2, 15, 0, 0)))
    other = Machine((ROOT, Step(1, 2, 0, 0), Step(2, 15, 0, 3)))
    assert tree_hash(first) == tree_hash(renumbered) != tree_hash(other)


def test_a_folder_without_runs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="holds no runs and no evaluations: name a run directory"):
        evaluation_trees([tmp_path])
    shutil.copytree(RECORDED, tmp_path / "run")
    (tmp_path / "run" / "machines" / "bad.json").write_text("no machine")
    with pytest.raises(RunError, match=r"bad\.json is damaged: it holds no machine"):
        evaluation_trees([tmp_path])

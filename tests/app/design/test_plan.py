"""The conditions of a run are recorded, and later changes are reported."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, fields, replace
from pathlib import Path

import pytest

from agentflow.app.design.conditions import describe_changes
from agentflow.app.design.plan import RunPlan
from agentflow.app.design.replay import replay
from agentflow.app.design.run import RunOptions, resume
from agentflow.app.subjects.verify import rescore
from agentflow.config.run import build_config
from agentflow.env.tasks.families.movement import Movement
from agentflow.env.tasks.registry import get_task
from agentflow.errors import RunError
from agentflow.machine.brief import Brief
from agentflow.runs import RunDirectory, read_document
from agentflow.runs.reading import document_text
from tests.scripted import ScriptedClient

PLAN = RunPlan.of(build_config({"task": "movement", "workflow": "random-dsl", "workers": 1}))
RECORDED = Path(__file__).parents[3] / "runs" / "recorded-throwing"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, ""),
        ({"engine": "pybullet 3.2.7"}, "engine (pybullet 3.2.7, now 3.2.8)"),
        ({"blocks": "0"}, "blocks"),
        ({"engine": "other 3.2.8"}, "engine (other 3.2.8, now pybullet 3.2.8)"),
        (
            {"prompts": "0", "engine": "pybullet 3.2.7"},
            "prompts and engine (pybullet 3.2.7, now 3.2.8)",
        ),
        ({"seed": 7}, ""),
        (
            {"plugins": {"search strategy lazy": "idle 1.0 source 1111", "role gone": "old 2"}},
            "search strategy lazy (idle 1.0 source 1111, now 2222)",
        ),
    ],
)
def test_changed_conditions_are_named_with_versions(changed: dict[str, object], words: str) -> None:
    now = {**PLAN.run_document, "engine": "pybullet 3.2.8"}
    now |= {"plugins": {"search strategy lazy": "idle 1.0 source 2222"}}
    assert describe_changes({**now, **changed}, now) == words


@dataclass(frozen=True)
class Dancing(Movement):
    """A task whose purpose no mechanism serves."""

    @property
    def brief(self) -> Brief:
        return replace(super().brief, objective="Build a machine that dances.")


def test_the_procedural_model_knows_placement() -> None:
    config = build_config({"task": "gearing", "workflow": "placement"})
    assert RunPlan.of(config).model_note == ""


@pytest.mark.parametrize(
    ("workflow", "model", "warns"),
    [
        ("iterative", {}, True),
        ("random-dsl", {}, False),
        ("iterative", {"name": "some-model"}, False),
        ("iterative", {"name": "some-model", "roles": {"refiner": {"name": "procedural"}}}, True),
    ],
)
def test_a_task_unknown_to_the_procedural_model_is_named(
    workflow: str, model: dict[str, object], warns: bool
) -> None:
    config = build_config({"task": "movement", "workflow": workflow, "model": model})
    plan = RunPlan.of(config)
    assert plan.model_note == ""
    task = get_task("movement")
    dancing = Dancing(**{item.name: getattr(task, item.name) for item in fields(task)})
    assert replace(plan, task=dancing).model_note.startswith(
        "the procedural model has no mechanism for movement, so " if warns else ""
    )
    assert bool(replace(plan, task=dancing).model_note) is warns


def test_resuming_with_another_engine_is_refused(tmp_path: Path) -> None:
    plan = replace(PLAN, engine="pybullet 0.0.1")
    run = RunDirectory.create(tmp_path, "run", plan.run_document)
    run.close()
    now = PLAN.engine.removeprefix("pybullet ")
    with pytest.raises(RunError) as caught:
        resume(run.path)
    assert str(caught.value) == (
        f"{run.path} was started with different engine (pybullet 0.0.1, now {now}), so its "
        "recording cannot be continued; resume it with the version that started it"
    )


@pytest.mark.slow
def test_a_run_without_a_recorded_engine_resumes_with_a_note(tmp_path: Path) -> None:
    document = PLAN.run_document
    del document["engine"]
    plan = {**document, "config": {**document["config"], "settings": {"max_simulations": 1}}}
    run = RunDirectory.create(tmp_path, "run", plan)
    run.close()
    notes: list[str] = []
    result = resume(run.path, RunOptions(notes.append, client=ScriptedClient(str)))
    assert result.rollouts == 1
    assert notes == [
        f"{run.path}: the run does not record its physics engine; now it is {PLAN.engine}"
    ]


@pytest.mark.slow
def test_replay_and_rescore_report_another_engine(tmp_path: Path) -> None:
    run = shutil.copytree(RECORDED, tmp_path / "run")
    document = {**read_document(run), "engine": "pybullet 0.0.1"}
    (run / "run.yaml").write_text(document_text(document))
    now = PLAN.engine.removeprefix("pybullet ")
    notes: list[str] = []
    replay(run, notes.append)
    assert notes == [
        f"{run} was made with different engine (pybullet 0.0.1, now {now}); expect differences"
    ]
    assert rescore(run)["engine"] == {"recorded": "pybullet 0.0.1", "now": PLAN.engine}

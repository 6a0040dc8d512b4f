"""The Python interface: names, results, and cheap imports."""

from __future__ import annotations

import asyncio
import inspect
import json
from importlib.resources import files
from pathlib import Path

import pytest

import agentflow
from agentflow.app.design.plan import RunPlan
from agentflow.app.design.replay import replay
from agentflow.app.prompts import render_prompt
from agentflow.cli import main
from agentflow.config.run import DesignConfig, build_config
from agentflow.env.tasks.registry import get_task
from agentflow.errors import ConfigError, RunError, UnknownNameError, UsageError
from agentflow.runs import RunDirectory, read_document
from tests.processes import run_python
from tests.workflows.fakes import Author

ROOT = Path(__file__).parents[1]
CAR = ROOT / "examples" / "car.json"
TEXT = CAR.read_text()
ONE = {"trajectories": 1}
TINY = {"trajectories": 1, "search.rounds": 0}


def car(_request: agentflow.Request) -> str:
    return f"```json\n{TEXT}\n```"


def test_every_public_name_exists_and_is_documented() -> None:
    assert dir(agentflow) == sorted(agentflow.__all__)
    for name in agentflow.__all__:
        value = getattr(agentflow, name)
        if getattr(value, "__module__", "").startswith("agentflow"):
            assert value.__doc__, name
    with pytest.raises(AttributeError, match="module 'agentflow' has no attribute 'desing'"):
        _ = agentflow.desing  # type: ignore[attr-defined]
    assert (files("agentflow") / "py.typed").is_file()


def test_importing_the_package_loads_nothing_else() -> None:
    code = "import sys, agentflow; print(*(n for n in sys.modules if n.startswith('agentflow')))"
    assert {*run_python("-c", code).stdout.split()} == {"agentflow", "agentflow.version"}


def test_checking_a_machine_loads_no_physics() -> None:
    code = "import sys, agentflow; agentflow.check('[]'); print('numpy' in sys.modules)"
    assert run_python("-c", code).stdout == "False\n"


def test_a_file_name_given_as_text_suggests_path() -> None:
    for name in (str(CAR), "none.json", "my machines/none.bsg"):
        wanted = f"{name!r} is the name of a file, not the text of a machine: pass Path({name!r})"
        for ask in (agentflow.check, agentflow.simulate, agentflow.verify):
            with pytest.raises(UsageError) as refused:
                ask(name, "movement")
            assert str(refused.value) == wanted
    for text in ("x" * 5000 + "\0", "nothing", "[1] car.json", '{"a": "car.json"'):
        assert not agentflow.check(text).file_valid


def test_defaults_match_the_command_line() -> None:
    for function in (agentflow.design, agentflow.design_async):
        parameters = inspect.signature(function).parameters
        defaults = {name: parameters[name].default for name in parameters}
        assert defaults.pop("out") == "runs"
        assert defaults.pop("trust") is False
        assert defaults.pop("jobs") == 2
        assert set(defaults.values()) == {None}
    assert inspect.signature(agentflow.simulate).parameters["seed"].default == 0
    assert inspect.signature(agentflow.reward).parameters["seed"].default == DesignConfig().seed


@pytest.mark.parametrize("name", ["design", "resume", "sweep", "simulate", "verify", "reward"])
def test_twins_take_the_same_arguments(name: str) -> None:
    """Of each pair, the one for event loops takes a pool as well; no type can say that."""
    twin = inspect.signature(getattr(agentflow, f"{name}_async"))
    others = [each for each in twin.parameters.values() if each.name != "pool"]
    assert inspect.signature(getattr(agentflow, name)) == twin.replace(parameters=others)


def test_the_prompt_for_a_trainer_is_what_a_designer_gets() -> None:
    system, user = agentflow.design_prompt("throwing", knobs={"wall.height": 2})
    shown = render_prompt("default", "designer", get_task("throwing", {"wall.height": 2}).brief)
    assert system == {"role": "system", "content": shown["system"]}
    assert user == {"role": "user", "content": shown["user"]}
    with pytest.raises(UnknownNameError, match="unknown prompt set 'defalt'; known: default"):
        agentflow.design_prompt("throwing", prompts="defalt")


@pytest.mark.parametrize("machine", [CAR, TEXT, f"```json\n{TEXT}```", json.loads(TEXT)])
def test_check_accepts_every_form(machine: object) -> None:
    report = agentflow.check(machine, task="movement")  # type: ignore[arg-type]
    assert report.task_valid
    assert agentflow.check(report.machine) == agentflow.check(CAR)  # type: ignore[arg-type]


def test_check_reports_the_same_errors_as_the_command() -> None:
    assert [p.code for p in agentflow.check("nothing").problems] == ["not_json"]
    assert not agentflow.check(CAR, "throwing").task_valid
    with pytest.raises(UsageError, match="knobs change a task; name it with task="):
        agentflow.check(CAR, knobs={"window": 3})
    with pytest.raises(UnknownNameError, match="unknown task 'movment'; known: movement"):
        agentflow.check(CAR, "movment")
    with pytest.raises(UsageError, match="cannot read none: No such file"):
        agentflow.check(Path("none"))


@pytest.mark.slow
async def test_simulate_and_reward_agree_with_and_without_a_pool() -> None:
    alone = agentflow.simulate(CAR, "movement", knobs={"window": 1})
    worth = agentflow.reward("movement", f"Like this:\n{car(None)}", knobs={"window": 1})  # type: ignore[arg-type]
    async with agentflow.RolloutPool(1) as pool:
        pooled = await agentflow.simulate_async(CAR, "movement", pool, knobs={"window": 1})
        again = await agentflow.reward_async("movement", TEXT, pool, knobs={"window": 1})
    assert alone.digest == pooled.digest == worth.rollout.digest == again.rollout.digest
    assert worth.value == again.value == alone.score
    assert (worth.parsed, worth.spatial, worth.valid, worth.status) == (True, True, True, "ok")
    assert worth.value is not None
    assert worth.value > 1


@pytest.mark.parametrize(
    ("text", "parsed", "spatial", "codes"),
    [
        ("", False, None, ["not_json"]),
        ("[]", False, None, ["empty"]),
        (TEXT.replace('"type": 2', '"type": 999'), False, None, ["unknown_type"] * 4),
        (TEXT.replace('"face_id": 3', '"face_id": 2'), True, False, None),
    ],
)
def test_the_reward_of_an_unusable_reply(
    text: str, parsed: bool, spatial: bool | None, codes: list[str] | None
) -> None:
    worth = agentflow.reward("movement", text)
    assert (worth.value, worth.valid, worth.status) == (0.0, False, "invalid")
    assert (worth.parsed, worth.spatial) == (parsed, spatial)
    if codes is not None:
        assert [problem.code for problem in worth.problems] == codes
    assert worth.problems


def test_a_machine_without_required_blocks_gets_no_reward() -> None:
    worth = agentflow.reward("throwing", '[{"type": 0, "id": 0, "parent": -1, "face_id": -1}]')
    assert (worth.value, worth.parsed, worth.spatial, worth.valid) == (0.0, True, True, False)
    assert [problem.code for problem in worth.problems] == ["required_count"]


@pytest.mark.slow
def test_a_function_can_answer(tmp_path: Path) -> None:
    heard: list[str] = []
    found = agentflow.design(
        "movement",
        workflow="single",
        answer=car,
        settings={**TINY, "window": 1},
        seed=3,
        workers=1,
        out=tmp_path,
        listener=lambda event: heard.append(event.kind),
    )
    assert (found.valid, found.model, found.stopped) == (True, "car", None)
    assert found.machine == agentflow.check(CAR).machine
    assert found.score == agentflow.simulate(CAR, "movement", knobs={"window": 1}).score
    assert found.run.parent == tmp_path
    assert found.data["calls"] == 1
    assert heard[0] == "run"
    config = read_document(found.run)["config"]
    assert (config["model"]["name"], config["seed"], config["knobs"]) == ("car", 3, {"window": 1})
    assert replay(found.run, pytest.fail) is None
    assert agentflow.resume(found.run) == found


@pytest.mark.slow
async def test_a_coroutine_function_can_answer(tmp_path: Path) -> None:
    async def remote(request: agentflow.Request) -> agentflow.Reply:
        await asyncio.sleep(0)
        return agentflow.Reply(text=car(request), usage=agentflow.Usage(prompt=7))

    async with agentflow.RolloutPool(1) as pool:
        runs = [
            agentflow.design_async(
                "movement",
                workflow="single",
                answer=remote,
                model="remote model",
                settings={**TINY, "window": 1},
                seed=seed,
                out=tmp_path,
                pool=pool,
            )
            for seed in (1, 2)
        ]
        first, second = await asyncio.gather(*runs)
    assert first.score == second.score
    assert (first.model, first.data["tokens"]) == ("remote model", 7)


async def test_blocking_functions_are_refused_on_an_event_loop(tmp_path: Path) -> None:
    with pytest.raises(UsageError) as caught:
        agentflow.design("movement", out=tmp_path)
    assert str(caught.value) == (
        "design blocks until its run ends; on an event loop, await design_async"
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"task": "thowing"}, "unknown task 'thowing'; known: throwing"),
        ({"workflow": "singel"}, "unknown workflow 'singel'; known: single"),
        ({"settings": {"search.wdth": 1}}, "unknown configuration key 'settings.search.wdth'"),
        ({"settings": {"wall.hight": 1}}, "unknown knob 'wall.hight' of throwing"),
        (
            {"answer": car, "model": "procedural"},
            "answer= replaces the model: use a model name other",
        ),
        ({"config": Path("none.yaml")}, "cannot read none.yaml"),
    ],
)
def test_invalid_arguments_leave_nothing_behind(
    options: dict[str, object], message: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError) as caught:
        agentflow.design(**options, out=tmp_path)  # type: ignore[arg-type]
    assert str(caught.value).startswith(message)
    assert list(tmp_path.iterdir()) == []


def test_a_function_that_returns_no_text_raises(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="must return a string or a Reply, not 7"):
        agentflow.design("movement", workflow="single", answer=lambda _: 7, workers=1, out=tmp_path)  # type: ignore[arg-type, return-value]


@pytest.mark.slow
def test_an_interrupted_run_with_a_function_can_be_resumed(tmp_path: Path) -> None:
    author, asked = Author(refused=0.0), []

    def failing(request: agentflow.Request) -> agentflow.Reply:
        if len(asked) == 2:
            raise KeyboardInterrupt
        asked.append(request.label)
        return author(request)

    settings = {"trajectories": 1, "search.rounds": 1, "search.width": 1, "window": 1}
    with pytest.raises(agentflow.AgentflowError, match="interrupted; continue in Python"):
        agentflow.design(
            "movement", workflow="single", answer=failing, settings=settings, out=tmp_path
        )
    (run,) = tmp_path.iterdir()
    found = agentflow.resume(run, answer=lambda request: author(request))
    assert found.data["calls"] > len(asked)
    assert found.model == "failing"


def test_a_mapping_can_be_the_configuration(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="unknown configuration key 'sed'; known: seed"):
        agentflow.design(config={"sed": 1}, out=tmp_path)


@pytest.mark.slow
def test_a_run_of_a_function_is_resumed_with_a_function(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = RunPlan.of(build_config({"task": "movement", "workflow": "single", "settings": ONE}))
    directory = RunDirectory.create(tmp_path, "run", {**plan.run_document, "answer": "car"})
    directory.close()
    run = directory.path
    problem = (
        f"{run} was started with the Python function 'car', which answers instead of a model; "
        f"continue it in Python: agentflow.resume({str(run)!r}, answer=...)"
    )
    assert main(["design", "--resume", str(run)]) == 2
    assert capsys.readouterr().err == f"agentflow: {problem}\n"
    with pytest.raises(RunError, match="answer="):
        agentflow.resume(run)
    assert agentflow.resume(run, answer=car).valid
    done = agentflow.design("movement", workflow="single", answer=car, settings=TINY, out=tmp_path)
    assert read_document(done.run)["answer"] == "car"

"""verifiers, as installed: its loaders, its rollouts, its command."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

import agentflow
from agentflow.machine import read_machine
from agentflow.rewards import reward
from agentflow.runs import read_result
from agentflow.tools.bench import TOOLS
from tests.conftest import stub_server
from tests.integrations.foreign import CAR, PLUGINS, documented_code, run_foreign
from tests.llm.foreign import ROOT, foreign_python
from tests.llm.hostile import Answer, serving, stream

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

VERIFIERS = ".venv-verifiers"
KEY = {"STUB_KEY": "none"}
NAME = read_machine(CAR).machine.digest[:8]
"""What the tools call the car."""
PLAY = """
import asyncio, json, sys
import verifiers.v1 as vf
from agentflow.integrations.verifiers.bench import BenchConfig
from agentflow_verifiers import load_environment

async def play(url, task, options):
    if "bench" in options:
        options["bench"] = BenchConfig(**options["bench"])
    env = load_environment(task, **options)
    client = vf.EvalClientConfig(base_url=url, api_key_var="STUB_KEY")
    context = vf.ModelContext(client=client, model="stub", sampling=vf.SamplingConfig())
    async with env.serving():
        for task in env.taskset:
            episode = await env.run_episode(task, context)
            print(json.dumps([trace.model_dump(mode="json") for trace in episode.traces]))

asyncio.run(play(*map(json.loads, sys.argv[1:])))
"""


@pytest.fixture(scope="module")
def car_url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A server whose model answers with a car, except on movement's second level."""
    fixtures = tmp_path_factory.mktemp("stub") / "fixtures.json"
    level_2 = {"messages": [{"content": {"contains": "Task: movement/2\n"}}]}
    replies = [
        {"name": "car", "match": {}, "response": {"content": f"A car:\n{CAR}"}},
        {"name": "words", "match": level_2, "response": {"content": "I cannot."}},
    ]
    fixtures.write_text(json.dumps({"fixtures": replies}))
    with stub_server(fixtures) as url:
        yield url


def call_tool(name: str, **arguments: object) -> Answer:
    """A reply that calls a tool."""
    function = {"name": name, "arguments": json.dumps(arguments)}
    call = {"index": 0, "id": f"call-{name}", "type": "function", "function": function}
    head = {"id": "reply", "object": "chat.completion.chunk", "created": 0, "model": "stub"}
    deltas = (({"role": "assistant", "tool_calls": [call]}, None), ({}, "tool_calls"))
    return stream(
        *(
            {**head, "choices": [{"index": 0, "delta": delta, "finish_reason": finish}]}
            for delta, finish in deltas
        )
    )


@pytest.fixture
def uv(tmp_path: Path) -> dict[str, str]:
    """In place of uv, which would download what verifiers' chat program needs: it is here."""
    program = tmp_path / "bin" / "uv"
    program.parent.mkdir()
    script = f"""#!/bin/sh
case "$*" in
    *--help) echo --script ;;
    "python find"*) echo {foreign_python(VERIFIERS)} ;;
esac
"""
    program.write_text(script)
    program.chmod(0o755)
    return {"PATH": f"{program.parent}{os.pathsep}{os.defpath}"}


def play(
    folder: Path, url: str, task: str, variables: Mapping[str, str] | None = None, **options: object
) -> list[dict[str, Any]]:
    """The traces of an environment's tasks, one rollout each."""
    arguments = map(json.dumps, (url, task, {"engine": "mujoco", **options}))
    variables = {**KEY, "PYTHONPATH": str(PLUGINS), **(variables or {})}
    printed = run_foreign(VERIFIERS, folder, "-c", PLAY, *arguments, variables=variables)
    return [trace for line in printed.splitlines() for trace in json.loads(line)]


@pytest.mark.mujoco
def test_rewards_are_those_of_the_simulation(tmp_path: Path, car_url: str) -> None:
    traces = play(tmp_path, car_url, "movement", seeds=2)
    told = [(trace["task"]["data"]["level"], trace["task"]["data"]["seed"]) for trace in traces]
    levels = ["movement", *(f"movement/{number}" for number in range(2, 8))]
    assert told == [(level, seed) for level in levels for seed in (0, 1)]
    assert all(trace["ok"] and trace["stop_condition"] == "agent_completed" for trace in traces)

    car, _, words, *_ = traces
    same = reward("movement", CAR, engine="mujoco")
    assert car["rewards"] == {"simulated_score": {"score": same.value, "weight": 1.0}}
    assert car["metrics"] == {"parsed": 1.0, "spatial": 1.0, "valid": 1.0}
    assert car["info"]["simulation"]["digest"] == same.rollout.digest
    asked = [node["message"] for node in car["nodes"][:2]]
    told = [{key: message[key] for key in ("role", "content")} for message in asked]
    assert told == agentflow.design_prompt("movement", engine="mujoco")

    assert words["rewards"] == {"simulated_score": {"score": 0.0, "weight": 1.0}}
    assert words["metrics"] == {"parsed": 0.0, "spatial": 0.0, "valid": 0.0}
    [problem] = words["info"]["simulation"]["problems"]
    assert problem["code"] == "not_json"


def test_a_crash_is_an_error_and_no_reward(tmp_path: Path, car_url: str) -> None:
    fine, crashed = play(tmp_path, car_url, "faulty")
    assert fine["ok"]
    assert fine["rewards"]["simulated_score"]["score"] > 1
    assert not crashed["ok"]
    assert crashed["rewards"] == {"simulated_score": None}
    assert crashed["info"]["simulation"]["status"] == "crashed"
    [error] = crashed["errors"]
    assert error["type"] == "TaskError"


def test_the_command_finds_the_environment(tmp_path: Path, car_url: str) -> None:
    command = foreign_python(VERIFIERS).with_name("vf-eval")
    here = ("--env.taskset.tasks", "movement/2", "--env.agent.runtime.type", "subprocess")
    client = ("--client.base-url", car_url, "--client.api-key-var", "STUB_KEY", "-m", "stub")
    options = (*here, *client, "--no-push", "--no-rich")
    run_foreign(VERIFIERS, tmp_path, command, "agentflow-verifiers", *options, variables=KEY)
    [traces] = tmp_path.glob("outputs/*/traces.jsonl")
    [episode] = map(json.loads, traces.read_text().splitlines())
    [trace] = episode["traces"]
    assert trace["rewards"]["simulated_score"]["score"] == 0.0


def test_the_folder_for_hubs_is_a_package_that_the_command_finds(
    tmp_path: Path, car_url: str
) -> None:
    folder = shutil.copytree(ROOT / "examples" / "verifiers", tmp_path / "folder")
    built = (foreign_python(VERIFIERS), "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path)
    subprocess.run([*map(str, built)], cwd=folder, check=True, capture_output=True)
    [wheel] = tmp_path.glob("agentflow_design-*.whl")
    shutil.unpack_archive(wheel, tmp_path / "site", "zip")
    command = foreign_python(VERIFIERS).with_name("vf-eval")
    here = ("--env.taskset.tasks", "movement/1", "--env.agent.runtime.type", "subprocess")
    client = ("--client.base-url", car_url, "--client.api-key-var", "STUB_KEY", "-m", "stub")
    options = (*here, "--env.taskset.engine", "mujoco", *client, "--no-push", "--no-rich")
    variables = {**KEY, "PYTHONPATH": str(tmp_path / "site")}
    run_foreign(VERIFIERS, tmp_path, command, "agentflow-design", *options, variables=variables)
    [traces] = tmp_path.glob("outputs/*/traces.jsonl")
    [trace] = json.loads(traces.read_text().splitlines()[0])["traces"]
    same = reward("movement", CAR, engine="mujoco").value
    assert trace["rewards"]["simulated_score"]["score"] == same


def test_the_documented_code_runs(tmp_path: Path, car_url: str) -> None:
    endpoint = {"OPENAI_BASE_URL": car_url, "OPENAI_API_KEY": "none"}
    code = documented_code("verifiers")
    assert run_foreign(VERIFIERS, tmp_path, "-c", code, variables=endpoint).count("valid: ") == 2


@pytest.mark.mujoco
async def test_a_model_works_with_tools_in_a_run(tmp_path: Path, uv: dict[str, str]) -> None:
    bench = {"rollouts": 3, "out": str(tmp_path / "runs")}
    steps = (call_tool("check", machine=CAR), call_tool("simulate", machine=NAME))
    async with serving(*steps, call_tool("submit", machine=NAME)) as server:
        [trace] = await asyncio.to_thread(
            play, tmp_path, server.base_url, "movement/1", uv, tools=True, bench=bench
        )
    assert trace["ok"], trace["errors"]
    assert trace["stop_condition"] == "submitted"
    same = reward("movement", CAR, engine="mujoco")
    assert trace["rewards"]["simulated_score"]["score"] == same.value

    assert len(server.asked) == 3
    offered = {tool["function"]["name"]: tool["function"] for tool in server.asked[0].body["tools"]}
    apart = ("pictures", "controls")  # without vision, and the task has no controls
    specs = {tool.spec.name: tool.spec for tool in TOOLS if tool.needs not in apart}
    assert {name: tool["description"] for name, tool in offered.items()} == {
        name: spec.description for name, spec in specs.items()
    }
    for name, spec in specs.items():
        schema = offered[name]["parameters"]
        for parameter in schema["properties"].values():
            del parameter["title"]
        assert schema["properties"] == spec.parameters["properties"]
        assert schema.get("required") == spec.parameters.get("required")
    system, user = server.asked[0].body["messages"]
    asked = agentflow.design_prompt("movement", engine="mujoco", role="agent")
    assert system == asked[0]
    assert (
        user["content"] == f"{asked[1]['content']}\nSubmit one machine. You have 3 simulations.\n"
    )
    assert "2 of 3 simulations left" in server.asked[2].body["messages"][-1]["content"]

    [run] = (tmp_path / "runs").iterdir()
    assert read_result(run).score == same.value

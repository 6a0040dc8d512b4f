"""Inspect AI, as installed: its command, its evaluation, its reader of logs."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

import agentflow
from agentflow.machine import read_machine
from agentflow.rewards import reward
from agentflow.runs import read_result, state_of
from agentflow.tools.bench import TOOLS
from tests.integrations.foreign import CAR, PLUGINS, documented_code, offer_examples, run_foreign
from tests.llm.foreign import foreign_python

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

INSPECT = ".venv-inspect"
NAME = read_machine(CAR).machine.digest[:8]
"""What the tools call the car."""
CALLS = [["check", {"machine": CAR}], ["submit", {"machine": NAME}]]
"""Tool calls that submit the car."""
READ = """
import json, sys
from pathlib import Path
from inspect_ai.log import read_eval_log

def read_log():
    [path] = Path("logs").glob("*.eval")
    log = read_eval_log(str(path))
    samples = [
        {"id": s.id, "target": s.target, "error": s.error, "run": s.metadata.get("run")}
        | {"messages": [message.text for message in s.messages]}
        | s.scores["simulation"].model_dump() for s in log.samples
    ]
    scores = [s.model_dump() for s in log.results.scores]
    told = {"status": log.status, "task": log.eval.task}
    return told | {"scores": scores, "samples": samples}
"""
"""Reads the only log in a folder, with Inspect's own reader."""
EVALUATE = """
from inspect_ai import eval
from inspect_ai.model import ModelOutput, ModelUsage, get_model

replies, task_args = json.loads(sys.argv[2]), json.loads(sys.argv[3])
offered = []

def find(messages):
    if isinstance(replies, dict):
        return next(reply for part, reply in replies.items() if part in messages[-1].text)
    made = sum(message.role == "assistant" for message in messages)
    return replies[min(made, len(replies) - 1)]

def answer(messages, tools, tool_choice, config):
    offered[:] = [tool.model_dump(exclude_none=True) for tool in tools]
    reply = find(messages)
    if isinstance(reply, str):
        output = ModelOutput.from_content("mockllm", reply)
    else:
        output = ModelOutput.for_tool_call("mockllm", *reply)
    output.usage = ModelUsage()
    return output

model = get_model("mockllm/model", custom_outputs=answer)
options = {"display": "none", "log_dir": "logs", "limit": task_args.pop("limit", None)}
options["message_limit"] = task_args.pop("message_limit", None)
eval(sys.argv[1], model=model, task_args={"engine": "mujoco", **task_args}, **options)
print(json.dumps([read_log(), offered]))
"""


def evaluate(
    folder: Path, task: str, replies: Mapping[str, str] | Sequence[object], **task_args: object
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Evaluate a model that answers by what the last message contains, or always in this order.

    Returns:
        The log, and the tools that the model was offered last.
    """
    with_plugins = {"PYTHONPATH": str(PLUGINS)}
    arguments = ("-c", READ + EVALUATE, task, json.dumps(replies), json.dumps(task_args))
    log, offered = json.loads(run_foreign(INSPECT, folder, *arguments, variables=with_plugins))
    return log, offered


@pytest.fixture
def encodings() -> dict[str, str]:
    """Lets the mock model find the encoding with which it counts tokens, and not download it."""
    [litellm] = foreign_python(".venv-gateway").parents[1].glob("lib/*/site-packages/litellm")
    return {"TIKTOKEN_CACHE_DIR": str(litellm / "litellm_core_utils" / "tokenizers")}


def test_the_documented_code_runs(tmp_path: Path) -> None:
    offer_examples(tmp_path)
    printed = run_foreign(INSPECT, tmp_path, "-c", documented_code("inspect-ai"))
    assert re.search(r"^movement/2 \{'score': \d+\.\d+, 'valid': True\}$", printed, re.MULTILINE)
    assert re.search(r"^1  movement/2 .* 4200$", printed, re.MULTILINE)


def test_the_command_evaluates_a_family(tmp_path: Path, encodings: dict[str, str]) -> None:
    command = foreign_python(INSPECT).with_name("inspect")
    options = ("--model", "mockllm/model", "--limit", "2", "--display", "plain")
    printed = run_foreign(
        INSPECT, tmp_path, command, "eval", "agentflow/throwing", *options, variables=encodings
    )
    assert "throwing (2 samples): mockllm/model" in printed
    log = json.loads(run_foreign(INSPECT, tmp_path, "-c", f"{READ}\nprint(json.dumps(read_log()))"))
    assert (log["status"], log["task"]) == ("success", "agentflow/throwing")
    assert [sample["id"] for sample in log["samples"]] == ["throwing", "throwing/2"]
    for sample in log["samples"]:
        assert sample["value"] == {"score": 0.0, "valid": False}
        assert sample["reason"] == "invalid_response_format"
        assert [problem["code"] for problem in sample["metadata"]["problems"]] == ["not_json"]


@pytest.mark.mujoco
def test_scores_are_those_of_the_simulation(tmp_path: Path) -> None:
    overlapping = CAR.replace('"face_id": 3', '"face_id": 2')
    replies = {"Task: movement\n": f"A car:\n{CAR}", "": overlapping}
    log, _ = evaluate(tmp_path, "agentflow/movement", replies)
    samples = {sample["id"]: sample for sample in log["samples"]}
    assert list(samples) == ["movement", *(f"movement/{level}" for level in range(2, 8))]

    driven, same = samples["movement"], reward("movement", CAR, engine="mujoco")
    assert driven["value"] == {"score": same.value, "valid": True}
    assert driven["target"] == "45.0"
    assert driven["metadata"]["engine"] == same.rollout.engine
    assert driven["metadata"]["digest"] == same.rollout.digest
    assert driven["metadata"]["terms"] == dict(same.rollout.terms)
    assert driven["metadata"]["status"] == "ok"
    assert json.loads(driven["answer"]) == json.loads(CAR)
    asked = agentflow.design_prompt("movement", engine="mujoco")
    assert driven["messages"] == [
        *(message["content"] for message in asked),
        replies["Task: movement\n"],
    ]

    for level in range(2, 7):
        invalid = samples[f"movement/{level}"]
        assert invalid["value"] == {"score": 0.0, "valid": False}
        assert invalid["reason"] is None
        assert {problem["code"] for problem in invalid["metadata"]["problems"]} == {"overlap"}
    metrics = {
        (score["name"], name): metric["value"]
        for score in log["scores"]
        for name, metric in score["metrics"].items()
    }
    assert same.value is not None
    assert metrics["score", "mean"] == pytest.approx(same.value / len(samples))
    assert metrics["score", "stderr"] == pytest.approx(same.value / len(samples))
    assert metrics["valid", "mean"] == pytest.approx(1 / len(samples))


@pytest.mark.parametrize("tools", [False, True])
def test_a_crash_is_left_out_of_the_metrics_and_counted(tmp_path: Path, tools: bool) -> None:
    log, _ = evaluate(tmp_path, "agentflow/faulty", CALLS if tools else [CAR], tools=tools)
    fine, crashed = log["samples"]
    assert log["status"] == "success"
    assert fine["value"]["valid"] is True
    assert fine["value"]["score"] > 1
    assert crashed["value"] != crashed["value"]  # not a number
    assert (crashed["reason"], crashed["metadata"]["status"]) == ("scoring_failed", "crashed")
    for score in log["scores"]:
        assert (score["scored_samples"], score["unscored_samples"]) == (1, 1)
        assert score["metrics"]["mean"]["value"] == fine["value"][score["name"]]


@pytest.mark.mujoco
def test_a_model_works_with_tools_in_a_run(tmp_path: Path) -> None:
    calls = [CALLS[0], ["simulate", {"machine": NAME}], ["look", {"machine": NAME}], CALLS[1]]
    options = {"tools": True, "vision": True, "limit": 1}
    log, offered = evaluate(tmp_path, "agentflow/movement", calls, **options)
    names = [tool.spec.name for tool in TOOLS if tool.needs != "controls"]
    assert [tool["name"] for tool in offered] == names
    [sample] = log["samples"]
    same = reward("movement", CAR, engine="mujoco")
    assert sample["value"] == {"score": same.value, "valid": True}
    assert sample["metadata"]["digest"] == same.rollout.digest
    system, user, budget, *_ = sample["messages"]
    asked = agentflow.design_prompt("movement", engine="mujoco", role="agent")
    assert [system, user] == [message["content"] for message in asked]
    assert "24 of 24 simulations left" in budget
    assert f"Machine {NAME} is submission 1 of 1" in sample["messages"][-1]
    run = read_result(tmp_path / sample["run"])
    assert (run.model, run.score) == ("Inspect AI mockllm/model", same.value)
    assert (tmp_path / sample["run"]).parent.name == "runs"


def test_a_model_that_never_submits_ends_at_the_limit(tmp_path: Path) -> None:
    options = {"tools": True, "limit": 1, "message_limit": 8}
    log, _ = evaluate(tmp_path, "agentflow/movement", CALLS[:1], **options)
    [sample] = log["samples"]
    assert (sample["value"], sample["error"]) == ({"score": 0.0, "valid": False}, None)
    assert state_of(tmp_path / sample["run"]) == "stopped"

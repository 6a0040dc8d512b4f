"""The model of each role, cost limits, and what is recorded of faults of an endpoint."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from agentflow.app.design.replay import replay
from agentflow.app.design.run import RunOptions, design
from agentflow.cli import main
from agentflow.config.run import DesignConfig, build_config
from agentflow.errors import ConfigError
from agentflow.llm.wrappers.record import CallLog
from agentflow.models.choices import choose_models, open_models
from agentflow.models.completion import require_model_name
from agentflow.runs import read_events
from tests.app.test_doctor import threaded
from tests.llm.hostile import body, completion, hang_up, reply

Captured = pytest.CaptureFixture[str]

KEY = "sk-models-4f1c77d09a"
CAR = json.dumps(
    [
        {"type": 0, "id": 0, "parent": -1, "face_id": -1},
        {"type": 2, "id": 1, "parent": 0, "face_id": 2},
        {"type": 2, "id": 2, "parent": 0, "face_id": 3},
    ]
)


def small(model: dict[str, object]) -> DesignConfig:
    """One machine from one call."""
    settings = {"trajectories": 1, "search": {"rounds": 0}}
    return build_config(
        {"task": "movement", "workflow": "single", "settings": settings, "model": model}
    )


@pytest.mark.parametrize(
    "words", [["design"], ["doctor"], ["sweep", "configs/inspector.yaml", "--dry-run"]]
)
def test_a_base_url_without_a_model_is_refused(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(Path(__file__).parents[2])
    assert main([*words, "--base-url", "http://127.0.0.1:9/v1"]) == 2
    assert capsys.readouterr().err == (
        "agentflow: a base URL is given without a model: name the model with --model (model.name, "
        "AGENTFLOW_MODEL)\n"
    )


def test_a_base_url_is_accepted_for_a_role_or_an_explicit_procedural_model() -> None:
    url = {"base_url": "http://127.0.0.1:9/v1"}
    require_model_name(build_config({"model": {**url, "roles": {"designer": {"name": "m"}}}}).model)
    require_model_name(build_config({"model": {**url, "name": "procedural"}}).model)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        (
            "model.budget.money=1",
            "model.budget.money needs a price for 'm': set model.prices to "
            "{m: {input: ..., output: ...}}, per million tokens",
        ),
        (
            "model.roles={referee: {name: x}}",
            "unknown role in model.roles 'referee'; known: refiner, ",
        ),
        (
            "model.roles={refiner: {nam: x}}",
            "unknown configuration key 'model.roles.refiner.nam'; known: model.roles.refiner.name,",
        ),
        (
            "model.key_variable=sk-models-4f1c77d09a",
            "model.key_variable takes the name of an environment variable, not a key\n",
        ),
        (
            "model.prices={m: {input: 1}}",
            "model.prices.m.output is missing\n",
        ),
        (
            "model.prices={m: {input: 1, output: 1, ouput: 1}}",
            "unknown configuration key 'model.prices.m.ouput'; known: model.prices.m.output, ",
        ),
    ],
)
def test_invalid_models_are_refused_at_the_start(
    setting: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["design", "--model", "m", "--set", setting, "--quiet"]) == 2
    assert capsys.readouterr().err.startswith(f"agentflow: {message}")
    assert os.listdir(tmp_path) == []


def test_a_cost_limit_needs_a_price_for_every_model_but_the_procedural_one() -> None:
    roles = {"refiner": {"name": "big"}, "querier": {"name": "procedural"}}
    model = {"name": "m", "budget": {"money": 1}, "roles": roles}
    price = {"input": 1, "output": 1}
    with pytest.raises(ConfigError, match="a price for 'big'"):
        choose_models(small({**model, "prices": {"m": price}}).model)
    found = choose_models(small({**model, "prices": {"m": price, "big": price}}).model)
    assert {role: item.display_name for role, item in found.items()} == {
        "meta_designer": "m",
        "designer": "m",
        "inspector": "m",
        "querier": "procedural (no language model)",
        "refiner": "big",
        "analyst": "m",
        "agent": "m",
    }


async def test_roles_with_the_same_model_share_its_client(tmp_path: Path) -> None:
    url = "http://127.0.0.1:9/v1"
    roles = {"refiner": {"name": "big", "sampling": {"temperature": 0.1}}}
    config = small({"name": "m", "base_url": url, "roles": roles})
    with CallLog(tmp_path / "calls.jsonl", pytest.fail) as call_log:
        models = open_models(config, call_log, pytest.fail)
        await models.aclose()
    assert len({id(client) for client in models.clients.values()}) == 2
    assert models.name_of(models.clients) == (
        "m (meta_designer, designer, inspector, querier, analyst, agent); big (refiner)"
    )
    assert models.choices["refiner"].sampling.temperature == 0.1
    assert models.choices["designer"].sampling.temperature == 0.7


@pytest.mark.slow
def test_a_run_records_endpoint_remarks_and_cost_but_no_key(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOUSE_KEY", KEY)
    busy = body({"error": {"message": f"slow down, {KEY}"}}, 429, Retry_After="0")
    refuses = body({"error": {"message": "top_p is not supported", "param": "top_p"}}, 400)
    echo = {**completion(f"With {KEY}:\n```json\n{CAR}\n```"), "model": KEY}
    said: list[str] = []
    with threaded(busy, refuses, body(echo)) as server:
        own = {"name": "m", "base_url": server.base_url, "key_variable": "HOUSE_KEY"}
        prices = {"m": {"input": 100, "output": 1000, "cached": 10}}
        result = design(
            small({"roles": {"designer": own}, "prices": prices}), tmp_path, RunOptions(said.append)
        )
    # 11 prompt tokens, 5 of them cached, and 7 completion tokens.
    assert result.cost == pytest.approx((6 * 100 + 5 * 10 + 7 * 1000) / 1e6)
    assert (result.valid, result.calls, result.tokens) == (True, 1, 18)
    assert result.model == (
        "procedural (no language model) (meta_designer, inspector, querier, refiner); m (designer)"
    )
    where = server.base_url
    assert said == [
        f"designer/traj-1/attempt-1: {where} is temporarily unavailable (429: slow down, ***); "
        "retrying in 0.0 s",
        "the endpoint does not support top_p: omitted from now on (top_p is not supported)",
    ]
    run = Path(result.run)
    assert [e.data["text"] for e in read_events(run) if e.kind == "remark"] == said
    assert replay(run, pytest.fail) is None
    written = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert not any(KEY.encode() in path.read_bytes() for path in written)


@pytest.mark.slow
def test_a_run_that_loses_its_endpoint_says_so_and_continues_numbering(
    tmp_path: Path, capsys: Captured
) -> None:
    with threaded(reply(f"```json\n{CAR}\n```"), hang_up) as server:
        settings = ["--set", "trajectories=1", "--set", "model.endpoint.retry.attempts=1"]
        job = ["--task", "movement", "--workflow", "iterative", *settings, "--quiet"]
        where = ["--model", "m", "--base-url", server.base_url, "--out", str(tmp_path)]
        assert main(["design", *job, *where]) == 4
        (run,) = tmp_path.iterdir()
        first = [e.data["text"] for e in read_events(run) if e.kind == "remark"]
        assert main(["design", "--resume", str(run), "--trust", "--quiet"]) == 4
    assert len(first) == 1
    assert first[0].startswith(f"no answer from {server.base_url} (")
    remarks = [(e.label, e.data["text"]) for e in read_events(run) if e.kind == "remark"]
    assert remarks == [("1", first[0]), ("2", first[0])]
    hint = f"continue with: agentflow design --resume {run} --trust"
    assert capsys.readouterr().err == f"agentflow: {first[0]}; {hint}\n" * 2

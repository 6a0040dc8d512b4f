"""`agentflow doctor`: output, exit status, and no keys."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from agentflow.cli import main
from tests.llm.hostile import Answer, Server, body, reply, serving

KEY = "sk-doctor-4f1c77d09a"


@contextmanager
def threaded(*answers: Answer) -> Iterator[Server]:
    """A hostile server in a thread; the command runs another event loop."""
    ready, done = threading.Event(), asyncio.Event()
    kept: list[tuple[Server, asyncio.AbstractEventLoop]] = []

    async def serve() -> None:
        async with serving(*answers) as server:
            kept.append((server, asyncio.get_running_loop()))
            ready.set()
            await done.wait()

    thread = threading.Thread(target=asyncio.run, args=(serve(),))
    thread.start()
    assert ready.wait(10)
    server, loop = kept[0]
    try:
        yield server
    finally:
        loop.call_soon_threadsafe(done.set)
        thread.join(10)


@pytest.mark.slow
def test_a_third_party_server(
    stub_url: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("OPENAI_BASE_URL", stub_url)
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    assert main(["doctor", "--model", "some-model"]) == 0
    captured = capsys.readouterr()
    *lines, latency = captured.out.splitlines()
    assert lines == [
        f"endpoint: {stub_url}",
        "model: some-model (answers as some-model)",
        "reachable: yes",
        "authorised: yes",
        "model exists: yes",
        "streaming: yes",
        "reports tokens: no",
        "returns reasoning: no",
        "machine: none in the reply: the model may be too small to design machines",
    ]
    assert latency.startswith("latency: ")
    assert captured.err == ""


def test_a_limited_server_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    refusals = [
        body({"error": {"message": f"{name} is not supported", "param": name}}, 400)
        for name in ("temperature", "response_format", "response_format")
    ]
    with threaded(*refusals, reply('{"ok": true}', reasoning="hm")) as server:
        assert main(["doctor", "--model", "m", "--base-url", server.base_url, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found.pop("latency_s") >= 0
    assert found == {
        "model": "m",
        "base_url": server.base_url,
        "reachable": True,
        "authorised": True,
        "model_exists": True,
        "streaming": False,
        "refused": {
            "temperature": "omitted",
            "response_format json_schema": "replaced by json_object",
            "response_format json_object": "omitted",
        },
        "usage": True,
        "reasoning": True,
        "answered_as": "model-as-answered",
        "problem": "",
        "machine": "none in the reply: the model may be too small to design machines",
    }
    formats = [asked.body.get("response_format", {}).get("type") for asked in server.asked]
    assert formats == ["json_schema", "json_schema", "json_object", None]


MACHINE = [
    {"type": 0, "id": 0, "parent": -1, "face_id": -1},
    {"type": 15, "id": 1, "parent": 0, "face_id": 0},
    {"type": 2, "id": 2, "parent": 1, "face_id": 0},
]


def test_a_model_that_calls_tools(capsys: pytest.CaptureFixture[str]) -> None:
    function = {"name": "check", "arguments": json.dumps({"machine": MACHINE})}
    with threaded(reply(None, "tool_calls", tool_calls=[{"function": function}])) as server:
        options = ["--model", "m", "--base-url", server.base_url, "--role", "agent"]
        assert main(["doctor", *options]) == 0
    assert "machine: valid, 3 blocks\n" in capsys.readouterr().out
    (asked,) = server.asked
    assert [tool["function"]["name"] for tool in asked.body["tools"]] == ["check"]
    assert "tool_choice" not in asked.body


def test_a_server_that_ignores_tools_ends_with_4(capsys: pytest.CaptureFixture[str]) -> None:
    with threaded(reply(json.dumps({"machine": MACHINE}))) as server:
        options = ["--model", "m", "--base-url", server.base_url, "--role", "agent"]
        assert main(["doctor", *options]) == 4
    assert capsys.readouterr().err == (
        f"agentflow: {server.base_url}, model 'm': the reply calls no tool, although the "
        "prompt asked for it: the server may ignore tools; switch on tool calling at the server, "
        "or use another model, or a workflow without tools\n"
    )


def test_an_unusable_endpoint_ends_with_4_and_shows_no_key(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    with threaded(body({"error": {"message": f"bad key {KEY}"}}, 401)) as server:
        assert main(["doctor", "--model", "m", "--base-url", server.base_url]) == 4
    captured = capsys.readouterr()
    assert captured.out.splitlines()[2:5] == [
        "reachable: yes",
        "authorised: no",
        "model exists: unknown",
    ]
    assert captured.err == (
        f"agentflow: {server.base_url} rejected the API key or denied it access to model 'm' "
        "(401: bad key ***); check OPENAI_API_KEY\n"
    )
    assert KEY not in captured.out


def test_the_endpoint_of_a_role_gets_its_key_or_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    monkeypatch.setenv("HOUSE_KEY", "the-key-of-the-house")
    with threaded(reply("x")) as server:
        roles = {
            "refiner": {"name": "r", "base_url": server.base_url, "key_variable": "HOUSE_KEY"},
            "querier": {"name": "q", "base_url": server.base_url},
            "inspector": {"name": "i"},
        }
        model = {"name": "m", "base_url": server.base_url, "roles": roles}
        (tmp_path / "c.yaml").write_text(json.dumps({"model": model}))
        for role in ("refiner", "querier", "inspector", "designer"):
            assert (
                main(["doctor", "--config", str(tmp_path / "c.yaml"), "--role", role, "--trust"])
                == 0
            )
    sent = [(asked.body["model"], asked.headers.get("authorization")) for asked in server.asked]
    assert sent == [
        ("r", "Bearer the-key-of-the-house"),
        ("q", None),
        ("i", f"Bearer {KEY}"),
        ("m", f"Bearer {KEY}"),
    ]
    assert "model: r (answers as" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "the procedural model has no endpoint to check; name a model with --model or"),
        (["--model", "m", "--role", "referee"], "unknown role 'referee'; known: refiner, "),
        (["--model", "m", "--base-url", "localhost"], "the base URL must look like http://"),
    ],
)
def test_roles_and_models_that_cannot_be_checked_are_refused(
    arguments: list[str],
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.delenv("AGENTFLOW_MODEL", raising=False)
    assert main(["doctor", *arguments]) == 2
    assert capsys.readouterr().err.startswith(f"agentflow: {message}")

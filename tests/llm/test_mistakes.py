"""Mistakes with endpoints: `agentflow doctor` says what to change, in one line."""

from __future__ import annotations

import json
import re

import pytest

from agentflow.cli import main
from tests.app.test_doctor import threaded
from tests.llm.hostile import Answer, body, hang_up, reply, reset

TOOLS = [{"id": "1", "type": "function", "function": {"name": "build", "arguments": "{}"}}]
NO_PATH = body({"detail": "Not Found"}, 404)
MISTAKES: dict[str, tuple[Answer, str, str, int]] = {
    # the server's answer, what is appended to its address, the sentence, the exit status
    "wrong path": (
        NO_PATH,
        "/other/v1",
        "URL/other/v1 has no /chat/completions, or does not know model 'm' (404: Not Found); check "
        "OPENAI_BASE_URL or --base-url, then --model",
        4,
    ),
    "no /v1": (
        NO_PATH,
        "",
        "URL has no /chat/completions, or does not know model 'm' (404: Not Found); most servers "
        "answer at URL/v1: check OPENAI_BASE_URL or --base-url",
        4,
    ),
    "no /v1 and a web page": (
        body("<html>", kind="text/html"),
        "/",
        "URL did not return a chat completion (an HTML page); most servers answer at URL/v1: check "
        "OPENAI_BASE_URL or --base-url",
        4,
    ),
    "/chat/completions at the end": (
        NO_PATH,
        "/v1/chat/completions/",
        "the base URL URL/v1/chat/completions must end before /chat/completions: change --base-url "
        "or OPENAI_BASE_URL to URL/v1",
        2,
    ),
    "wrong model": (
        body({"error": {"message": "The model `m` does not exist."}}, 404),
        "/v1",
        "model 'm' not found at URL/v1 (404: The model `m` does not exist.); check --model and "
        "--base-url",
        4,
    ),
    "empty reply": (
        reply(""),
        "/v1",
        "URL/v1, model 'm': the reply has no text: if the model reasons, its server may return "
        "only the reasoning; else its chat template may not fit the model; change the server's "
        "settings or the model",
        4,
    ),
    "tool calls only": (
        reply(None, "tool_calls", tool_calls=TOOLS),
        "/v1",
        "URL/v1, model 'm': the reply has only tool calls, but agentflow reads text: switch off "
        "tool calling at the server, or use another model",
        4,
    ),
    "cut off": (
        reply("[{", "length"),
        "/v1",
        "URL/v1, model 'm': the reply was cut off at 2048 tokens: use a model that reasons less, "
        "or raise the server's limit of output tokens",
        4,
    ),
    "truncated JSON": (
        body('{"choices": [{"mess'),
        "/v1",
        "no complete reply from URL/v1 (the answer's JSON is incomplete); the server, or a proxy "
        "before it, cut it off: check their logs and size limits",
        4,
    ),
    "wrong key": (
        body({"error": {"message": "bad"}}, 401),
        "/v1",
        "URL/v1 rejected the API key or denied it access to model 'm' (401: bad); check "
        "OPENAI_API_KEY",
        4,
    ),
    "connection reset": (
        reset,
        "/v1",
        "no answer from URL/v1 (connection reset); check OPENAI_BASE_URL or --base-url",
        4,
    ),
    "connection closed": (
        hang_up,
        "/v1",
        "no answer from URL/v1 (Server disconnected without sending a response.); check "
        "OPENAI_BASE_URL or --base-url",
        4,
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_the_sentence_that_mends_it(
    mistake: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-mistaken-key")
    answer, path, sentence, status = MISTAKES[mistake]
    with threaded(answer) as server:
        url = server.base_url.removesuffix("/v1")
        assert main(["doctor", "--model", "m", "--base-url", url + path]) == status
    captured = capsys.readouterr()
    shown = re.sub("(?<!base )(?<!BASE_)URL|(?<=base URL )URL", url, sentence)
    assert captured.err == f"agentflow: {shown}\n"
    assert "sk-mistaken-key" not in captured.out


def test_no_server(capsys: pytest.CaptureFixture[str]) -> None:
    with threaded(hang_up) as server:
        url = server.base_url
    assert main(["doctor", "--model", "m", "--base-url", url]) == 4
    assert capsys.readouterr().err == (
        f"agentflow: no answer from {url} (connection refused: is the server running?); check "
        "OPENAI_BASE_URL or --base-url\n"
    )


CAR = [
    {"type": 0, "id": 0, "parent": -1, "face_id": -1},
    {"type": 15, "id": 1, "parent": 0, "face_id": 0},
    {"type": 2, "id": 2, "parent": 1, "face_id": 0},
]


@pytest.mark.parametrize(
    ("text", "verdict"),
    [
        (json.dumps({"machine": CAR}), "valid, 3 blocks"),
        (f"```json\n{json.dumps(CAR)}\n```", "valid, 3 blocks"),
        (json.dumps([CAR[0], {**CAR[1], "parent": 7}]), "invalid: block 1: "),
        ("I cannot.", "none in the reply: the model may be too small to design machines"),
    ],
)
def test_the_machine_is_judged(text: str, verdict: str, capsys: pytest.CaptureFixture[str]) -> None:
    with threaded(reply(text)) as server:
        assert main(["doctor", "--model", "m", "--base-url", server.base_url]) == 0
    assert re.search(f"^machine: {re.escape(verdict)}", capsys.readouterr().out, re.MULTILINE)

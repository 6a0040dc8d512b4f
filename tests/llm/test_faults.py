"""Errors for error responses, and their messages."""

from __future__ import annotations

from datetime import datetime, timezone

import pytest

from agentflow.errors import EndpointError, ModelNotFoundError, RefusedError, UnauthorisedError
from agentflow.llm.endpoint.body import Endpoint
from agentflow.llm.endpoint.faults import (
    ErrorResponse,
    TransientFault,
    error_for,
    parse_error_object,
    read_error_response,
    retry_after_s,
)

ENDPOINT = Endpoint("m", "http://h/v1", "my-own-key")
NOW = datetime(2025, 1, 1, 12, 0, 0, tzinfo=timezone.utc)


@pytest.mark.parametrize(
    ("value", "seconds"),
    [
        ("7", 7.0),
        (" 0.5 ", 0.5),
        ("Wed, 01 Jan 2025 12:00:30 GMT", 30.0),
        ("Wed, 01 Jan 2025 12:00:30 -0000", 30.0),
        ("Wed, 01 Jan 2025 11:00:00 GMT", 0.0),
        ("soon", None),
        ("-3", None),
        ("nan", None),
        ("inf", None),
        ("99999999999999999999", None),
        ("Wed, 01 Jan 99999999999999999999 00:00:00 GMT", None),
        ("", None),
        (None, None),
    ],
)
def test_retry_after(value: str | None, seconds: float | None) -> None:
    assert retry_after_s(value, NOW) == seconds


@pytest.mark.parametrize(
    ("status", "kind", "text"),
    [
        (
            400,
            RefusedError,
            "http://h/v1 rejected the request (400: problem)",
        ),
        (
            401,
            UnauthorisedError,
            "http://h/v1 rejected the API key or denied it access to model 'm' (401: problem); "
            "check OPENAI_API_KEY",
        ),
        (
            403,
            UnauthorisedError,
            "http://h/v1 rejected the API key or denied it access to model 'm' (403: problem); "
            "check OPENAI_API_KEY",
        ),
        (
            404,
            ModelNotFoundError,
            "http://h/v1 has no /chat/completions, or does not know model 'm' (404: problem); "
            "check OPENAI_BASE_URL or --base-url, then --model",
        ),
        (429, TransientFault, "http://h/v1 is temporarily unavailable (429: problem)"),
    ],
)
def test_errors_by_status(status: int, kind: type[EndpointError], text: str) -> None:
    error = error_for(ENDPOINT, ErrorResponse(status, "problem"))
    assert (type(error), str(error)) == (kind, text)


@pytest.mark.parametrize(
    "problem",
    [
        "Invalid model name passed in model=m. Call `/v1/models`",
        "Unknown model: m",
        "The model `m` does not exist",
        'model "m" not found, try pulling it first',
        "Server is pinned to 'tiny@main'; requested 'm@main'.",
    ],
)
def test_an_unknown_model_with_any_status(problem: str) -> None:
    error = error_for(ENDPOINT, ErrorResponse(400, problem))
    expected = f"model 'm' not found at http://h/v1 (400: {problem}); check --model and --base-url"
    assert (type(error), str(error)) == (ModelNotFoundError, expected)


@pytest.mark.parametrize("status", [400, *range(401, 430), 500, 501, 502, 503, 504, 505, 529])
def test_only_the_listed_statuses_are_retried(status: int) -> None:
    listed = {408, 409, 425, 429, 500, 502, 503, 504, 529}
    error = error_for(ENDPOINT, ErrorResponse(status, "x"))
    assert isinstance(error, TransientFault) == (status in listed)


def test_a_missing_key_names_its_variable() -> None:
    error = error_for(Endpoint("m", "http://h", key_variable="HOUSE_KEY"), ErrorResponse(401, "no"))
    assert str(error) == "http://h requires an API key (401); set HOUSE_KEY"


def test_the_final_error_keeps_its_class() -> None:
    fault = error_for(ENDPOINT, ErrorResponse(503, "busy"))
    assert isinstance(fault, TransientFault)
    assert str(fault.final_error(1)) == "http://h/v1 is temporarily unavailable (503: busy)"
    last = fault.final_error(6)
    assert type(last) is RefusedError
    assert str(last) == "http://h/v1 is temporarily unavailable (503: busy) (after 6 attempts)"


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (b'{"error": {"message": "too long"}}', "too long"),
        (b'{"error": "too long"}', "too long"),
        (b'{"message": "too long", "object": "error"}', "too long"),
        (b'{"detail": "too long"}', "too long"),
        (b'{"detail": [{"msg": "too long"}]}', '[{"msg": "too long"}]'),
        (b"too long", "too long"),
        (b"<html>...", "an HTML page"),
        (b"", ""),
    ],
)
def test_messages_in_all_shapes(body: bytes, message: str) -> None:
    assert read_error_response(400, {}, body).message == message


def test_server_messages_are_masked_printable_and_short() -> None:
    words = "key my-own-key\n\x1b[31m" + "y" * 1000
    text = str(error_for(ENDPOINT, ErrorResponse(400, words)))
    assert text.startswith("http://h/v1 rejected the request (400: key *** [31myyy")
    assert text.endswith("yyy...)")
    assert len(text) < 350


def test_a_redirect_names_its_target() -> None:
    refusal = read_error_response(308, {"location": "https://h/v1"}, b"")
    assert refusal.message == "a redirect to https://h/v1"


@pytest.mark.parametrize(
    ("error", "status"),
    [
        ({"code": 502, "message": "x"}, 502),
        ({"code": "429"}, 429),
        ({"type": "overloaded_error"}, 529),
        ({"code": None, "type": "server_error"}, 500),
        ({"code": "model_not_found"}, 404),
        ({"code": 50001}, 400),
        ({"code": "²"}, 400),
        ({"code": "9" * 5000, "type": "not_found_error"}, 404),
        ("words", 400),
    ],
)
def test_error_objects_with_status_200(error: object, status: int) -> None:
    assert parse_error_object(200, {"error": error}).status == status

"""Turn error responses and connection failures into typed errors."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
from email.utils import parsedate_to_datetime

from agentflow.errors import (
    EndpointError,
    ModelNotFoundError,
    RefusedError,
    SilentError,
    UnauthorisedError,
    UnreachableError,
)
from agentflow.llm.endpoint.body import Endpoint

TRANSIENT_STATUSES = frozenset({408, 409, 425, 429, 500, 502, 503, 504, 529})
"""Statuses after which the same request may succeed later."""
_EXCERPT_CHARS = 300
_WORD_STATUS = {
    "invalid_api_key": 401,
    "authentication_error": 401,
    "permission_error": 403,
    "model_not_found": 404,
    "not_found_error": 404,
    "rate_limit_error": 429,
    "rate_limit_exceeded": 429,
    "server_error": 500,
    "internal_server_error": 500,
    "api_error": 500,
    "overloaded_error": 529,
}
"""HTTP statuses of vendors' error codes, which may arrive with status 200 or in a stream."""

_UNKNOWN_MODEL = re.compile(
    r"(?i)(?:invalid|unknown|no such) model|model_not_found"
    r"|model\b.{0,80}\b(?:does not exist|not found)"
    r"|server is pinned to '.{1,80}'; requested"
)
"""Messages of gateways and of the transformers server, which use status 400 instead of 404."""


class TransientFault(EndpointError):
    """A temporary failure; `error` is raised when retries do not help."""

    def __init__(self, error: EndpointError, retry_after_s: float | None = None) -> None:
        super().__init__(str(error))
        self.error = error
        self.retry_after_s = retry_after_s

    def final_error(self, attempts: int) -> EndpointError:
        """The error to raise after this many attempts."""
        if attempts == 1:
            return self.error
        return type(self.error)(f"{self.error} (after {attempts} attempts)")


@dataclass(frozen=True)
class ErrorResponse:
    """An error that a server returned instead of a reply."""

    status: int
    message: str
    param: str = ""
    """The parameter that it names, if any."""
    code: str = ""
    retry_after_s: float | None = None


def read_error_response(status: int, headers: Mapping[str, str], body: bytes) -> ErrorResponse:
    """Read a response with an error status: JSON, HTML or plain text."""
    text = body.decode("utf-8", "replace")
    try:
        content: object = json.loads(text)
    except (ValueError, RecursionError):
        content = None
    wait = retry_after_s(headers.get("retry-after"), datetime.now(timezone.utc))
    if isinstance(content, dict):
        return parse_error_object(status, content, wait)
    message = "an HTML page" if text.lstrip("\ufeff \t\r\n").startswith("<") else text
    if 300 <= status < 400:
        message = f"a redirect to {headers.get('location', 'nowhere')}"
    return ErrorResponse(status, message, retry_after_s=wait)


def parse_error_object(
    status: int, content: Mapping[str, object], wait: float | None = None
) -> ErrorResponse:
    """Read a JSON error object; a status inside it overrides 200."""
    error = content.get("error", content)
    if not isinstance(error, Mapping):
        error = {"message": error}
    words = [str(error.get(name) or "") for name in ("code", "type")]
    if status == 200:
        status = _status_in(words) or 400
    text = error.get("message") or error.get("detail") or content.get("detail") or error
    message = text if isinstance(text, str) else json.dumps(text)
    return ErrorResponse(status, message, str(error.get("param") or ""), words[0], wait)


def _status_in(words: list[str]) -> int | None:
    for word in words:
        if re.fullmatch(r"[45][0-9]{2}", word):
            return int(word)
        if word.lower() in _WORD_STATUS:
            return _WORD_STATUS[word.lower()]
    return None


def retry_after_s(value: str | None, now: datetime) -> float | None:
    """Seconds requested by a Retry-After header; None if it is absent or invalid.

    Args:
        value: The header: a number of seconds or an HTTP date.
        now: Current time, timezone-aware.
    """
    if value is None:
        return None
    if re.fullmatch(r"\s*\d{1,9}(\.\d*)?\s*", value):
        return float(value)
    try:
        then = parsedate_to_datetime(value)
    except (ValueError, OverflowError):
        return None
    if then.tzinfo is None:
        then = then.replace(tzinfo=timezone.utc)
    return max(0.0, (then - now).total_seconds())


def error_for(endpoint: Endpoint, response: ErrorResponse) -> EndpointError:
    """The typed error for an error response; a `TransientFault` if a retry may help."""
    status, where = response.status, endpoint.base_url
    message = printable_excerpt(endpoint, response.message)
    if status in (401, 403) and not endpoint.has_key:
        return UnauthorisedError(
            f"{where} requires an API key ({status}); set {endpoint.key_variable}"
        )
    if status in (401, 403):
        return UnauthorisedError(
            f"{where} rejected the API key or denied it access to "
            f"model {endpoint.model!r} ({status}: {message}); check {endpoint.key_variable}"
        )
    if status in (400, 404) and _UNKNOWN_MODEL.search(f"{response.message} {response.code}"):
        return ModelNotFoundError(
            f"model {endpoint.model!r} not found at {where} ({status}: {message}); "
            "check --model and --base-url"
        )
    if status in (404, 405):
        return ModelNotFoundError(
            f"{where} has no /chat/completions, or does not know model {endpoint.model!r} "
            f"({status}: {message}); {_address_advice(endpoint)}"
        )
    if status in TRANSIENT_STATUSES:
        error = RefusedError(f"{where} is temporarily unavailable ({status}: {message})")
        return TransientFault(error, response.retry_after_s)
    return RefusedError(f"{where} rejected the request ({status}: {message})")


def unable(endpoint: Endpoint, response: ErrorResponse, what: str, advice: str) -> RefusedError:
    """The error for a model or a server that cannot do something, such as call tools."""
    why = f"{response.status}: {printable_excerpt(endpoint, response.message)}"
    return RefusedError(f"model {endpoint.model!r} at {endpoint.base_url} {what} ({why}); {advice}")


def unreachable(endpoint: Endpoint, reason: str) -> TransientFault:
    """The error for a connection that failed, stalled or ended early."""
    return TransientFault(
        UnreachableError(
            f"no answer from {endpoint.base_url} ({printable_excerpt(endpoint, reason)}); "
            "check OPENAI_BASE_URL or --base-url"
        )
    )


def silent(endpoint: Endpoint, seconds: float) -> TransientFault:
    """The error for a connection on which nothing comes for so many seconds."""
    return TransientFault(
        SilentError(
            f"no data for {seconds:g} s from {endpoint.base_url}, which is connected: the model "
            "may be slow; model.endpoint.http.idle_s sets how long runs wait"
        )
    )


def not_a_completion(endpoint: Endpoint, reason: str) -> RefusedError:
    """The error for a successful response that is not a chat completion."""
    return RefusedError(
        f"{endpoint.base_url} did not return a chat completion "
        f"({printable_excerpt(endpoint, reason)}); {_address_advice(endpoint)}"
    )


def incomplete(endpoint: Endpoint, reason: str) -> TransientFault:
    """The error for a reply that ended early although the connection did not fail."""
    return TransientFault(
        UnreachableError(
            f"no complete reply from {endpoint.base_url} ({printable_excerpt(endpoint, reason)}); "
            "the server, or a proxy before it, cut it off: check their logs and size limits"
        )
    )


def _address_advice(endpoint: Endpoint) -> str:
    if url := endpoint.versioned_url:
        return f"most servers answer at {url}: check OPENAI_BASE_URL or --base-url"
    return "check OPENAI_BASE_URL or --base-url, then --model"


def printable_excerpt(endpoint: Endpoint, text: str) -> str:
    """One line for a terminal: without secrets, printable, shortened."""
    line = " ".join(endpoint.scrub(text).split())
    line = "".join(char for char in line if char.isprintable())
    if len(line) > _EXCERPT_CHARS:
        line = line[: _EXCERPT_CHARS - 3] + "..."
    return line or "no message"

"""Owns what a server's refusal means: which error it is, what it says, whether to try again.

Knows nothing of how requests are sent or how often they are repeated.
"""

from __future__ import annotations

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
    UnauthorisedError,
    UnreachableError,
)
from agentflow.llm.endpoint.address import Endpoint

TRANSIENT_STATUSES = frozenset({408, 409, 425, 429, 500, 502, 503, 504, 529})
"""Statuses after which the same request may succeed (spec 4.1)."""
_SHOWN_CHARS = 300
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
"""Error types and codes of vendors that come with status 200 or inside a stream."""

_UNKNOWN_MODEL = re.compile(
    r"(?i)(?:invalid|unknown|no such) model|model\b.{0,80}\b(?:does not exist|not found)"
    r"|server is pinned to '.{1,80}'; requested"
)
"""Wordings of gateways and of transformers' server, which answer 400 where others answer 404."""


class TransientFault(EndpointError):
    """A failure that may pass; `error` is what it becomes when it does not."""

    def __init__(self, error: EndpointError, retry_after_s: float | None = None) -> None:
        super().__init__(str(error))
        self.error = error
        self.retry_after_s = retry_after_s

    def given_up(self, attempts: int) -> EndpointError:
        """The final error after that many attempts."""
        if attempts == 1:
            return self.error
        return type(self.error)(f"{self.error} (after {attempts} attempts)")


@dataclass(frozen=True)
class Refusal:
    """What a server said instead of a reply."""

    status: int
    message: str
    """The server's own words, at full length."""
    param: str = ""
    """The parameter it names, where it names one."""
    code: str = ""
    retry_after_s: float | None = None


def read_refusal(status: int, headers: Mapping[str, str], body: bytes) -> Refusal:
    """Read an answer whose status is no success, in whatever form it came."""
    text = body.decode("utf-8", "replace")
    try:
        content: object = json.loads(text)
    except (ValueError, RecursionError):
        content = None
    wait = retry_after_s(headers.get("retry-after"), datetime.now(timezone.utc))
    if isinstance(content, dict):
        return refusal_of(status, content, wait)
    message = "an HTML page" if is_html(text) else text
    if 300 <= status < 400:
        message = f"a redirection to {headers.get('location', 'nowhere')}"
    return Refusal(status, message, retry_after_s=wait)


def refusal_of(status: int, content: Mapping[str, object], wait: float | None = None) -> Refusal:
    """Read an error object; a status inside it overrides 200."""
    error = content.get("error", content)
    if not isinstance(error, Mapping):
        error = {"message": error}
    words = [str(error.get(name) or "") for name in ("code", "type")]
    if status == 200:
        status = _status_in(words) or 400
    said = error.get("message") or error.get("detail") or content.get("detail") or error
    message = said if isinstance(said, str) else json.dumps(said)
    return Refusal(status, message, str(error.get("param") or ""), words[0], wait)


def _status_in(words: list[str]) -> int | None:
    for word in words:
        if re.fullmatch(r"[45][0-9]{2}", word):
            return int(word)
        if word.lower() in _WORD_STATUS:
            return _WORD_STATUS[word.lower()]
    return None


def retry_after_s(value: str | None, now: datetime) -> float | None:
    """Seconds that a Retry-After header asks for; None where it is absent or nonsense.

    Args:
        value: The header: a number of seconds or an HTTP date.
        now: An aware datetime to count a date from.
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


def error_for(endpoint: Endpoint, refusal: Refusal) -> EndpointError:
    """The typed error for a refusal; a `TransientFault` where a repetition may help."""
    status, where = refusal.status, endpoint.base_url
    said = shown(endpoint, refusal.message)
    if status in (401, 403):
        return UnauthorisedError(_unauthorised(endpoint, status, said))
    if status == 404 or (status == 400 and _UNKNOWN_MODEL.search(refusal.message)):
        return ModelNotFoundError(
            f"no model {endpoint.model!r} at {where} ({status}: {said}); "
            "check --model and --base-url"
        )
    if status in TRANSIENT_STATUSES:
        error = RefusedError(f"{where} cannot answer now ({status}: {said})")
        return TransientFault(error, refusal.retry_after_s)
    return RefusedError(f"{where} refuses the request ({status}: {said})")


def _unauthorised(endpoint: Endpoint, status: int, said: str) -> str:
    if not endpoint.has_key:
        return f"{endpoint.base_url} asks for a key ({status}); set {endpoint.key_variable}"
    return (
        f"{endpoint.base_url} refuses the key or its rights on model {endpoint.model!r} "
        f"({status}: {said}); check {endpoint.key_variable}"
    )


def unreachable(endpoint: Endpoint, reason: str) -> TransientFault:
    """The connection failed, stalled or broke off."""
    return TransientFault(
        UnreachableError(
            f"no answer from {endpoint.base_url} ({shown(endpoint, reason)}); "
            "check OPENAI_BASE_URL or --base-url"
        )
    )


def no_reply(endpoint: Endpoint, reason: str) -> RefusedError:
    """The server answered with success, but not with a chat completion."""
    return RefusedError(
        f"what answers at {endpoint.base_url} is no chat completion ({shown(endpoint, reason)}); "
        "check OPENAI_BASE_URL or --base-url"
    )


def shown(endpoint: Endpoint, text: str) -> str:
    """A server's words fit for one line of a terminal: scrubbed, printable, shortened."""
    line = " ".join(endpoint.scrub(text).split())
    line = "".join(char for char in line if char.isprintable())
    if len(line) > _SHOWN_CHARS:
        line = line[: _SHOWN_CHARS - 3] + "..."
    return line or "no message"


def is_html(text: str) -> bool:
    """Whether a body is a page for a browser."""
    return text.lstrip("\ufeff \t\r\n")[:1] == "<"

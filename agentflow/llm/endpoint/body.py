"""The JSON body of a request to `/chat/completions`, and its address: URL, model name, API key.

Only httpx and `scrub` see the key.
"""

import json
import re
from base64 import b64encode
from collections.abc import Generator, Iterable, Mapping, Sequence
from itertools import groupby

import httpx

from agentflow.errors import ConfigError
from agentflow.llm.endpoint.wire import is_json_object
from agentflow.llm.messages import JsonSchema, Message, NamedTool, Request, ToolCall

DEFAULT_BASE_URL = "https://api.openai.com/v1"
_PATH = "/chat/completions"
_SHORTEST_SECRET = 6
"""Shorter keys are placeholders for local servers ("EMPTY") and occur in ordinary text."""
_VERSION = re.compile(r"/v\d+\w*(?:/|$)")
_LOOKS_LIKE_A_KEY = re.compile(r"(?i)(?<=bearer )[\w.~+/*=-]{6,}|\bsk-[A-Za-z0-9_*.-]{6,}")


class _Bearer(httpx.Auth):
    """Adds the key when a request is sent, which keeps it out of stored headers."""

    def __init__(self, key: str) -> None:
        self._key = key

    def auth_flow(self, request: httpx.Request) -> Generator[httpx.Request, httpx.Response, None]:
        request.headers["Authorization"] = f"Bearer {self._key}"
        yield request


class Endpoint:
    """One model at one base URL.

    Args:
        model: Model name as the endpoint knows it.
        base_url: URL before `/chat/completions`, with or without a trailing slash.
        api_key: Sent as a bearer token unless None or empty.
        key_variable: Environment variable that holds the key, for error messages.

    Raises:
        ConfigError: The base URL is not an http(s) URL, or the key is not valid in a header.
    """

    def __init__(
        self,
        model: str,
        base_url: str = DEFAULT_BASE_URL,
        api_key: str | None = None,
        key_variable: str = "OPENAI_API_KEY",
    ) -> None:
        given = _parse_url(base_url)
        bare = given.copy_with(username=None, password=None)
        key = (api_key or "").strip()
        if not (key.isascii() and key.isprintable()) or " " in key:
            raise ConfigError(f"{key_variable} contains characters not allowed in an API key")
        self.model = model
        self.key_variable = key_variable
        self.has_key = bool(key)
        self.base_url = str(bare.copy_with(query=None, fragment=None)).rstrip("/")
        """Shown in messages: without credentials and query."""
        if self.base_url.endswith(_PATH):
            right = self.base_url.removesuffix(_PATH)
            raise ConfigError(
                f"the base URL {self.base_url} must end before {_PATH}: change --base-url or "
                f"OPENAI_BASE_URL to {right}"
            )
        self.url = bare.copy_with(path=bare.path.rstrip("/") + _PATH)
        basic = b64encode(f"{given.username}:{given.password}".encode()).decode()
        # URLs may carry a token as the user name, with no password or a dummy one.
        credential = max(given.password, given.username, key=_is_secret)
        self._secrets = [secret for secret in (key, credential, basic) if _is_secret(secret)]
        self.auth: httpx.Auth | None = _Bearer(key) if key else None
        """Authentication for httpx."""
        if self.auth is None and given.username:
            self.auth = httpx.BasicAuth(given.username, given.password)

    @property
    def versioned_url(self) -> str:
        """The base URL with `/v1`, if it has no such part; else ""."""
        return "" if _VERSION.search(self.base_url) else f"{self.base_url}/v1"

    @property
    def origin(self) -> str:
        """Scheme, host and port, e.g. "https://api.openai.com"."""
        return str(self.url.copy_with(raw_path=b"/")).rstrip("/")

    def scrub(self, text: str) -> str:
        """Mask this endpoint's secrets and anything else that looks like an API key."""
        return _LOOKS_LIKE_A_KEY.sub("***", self.scrub_known(text))

    def scrub_known(self, text: str) -> str:
        """Mask only this endpoint's own secrets (for replies)."""
        for secret in self._secrets:
            text = text.replace(secret, "***")
        return text

    def __repr__(self) -> str:
        return f"Endpoint(model={self.model!r}, base_url={self.base_url!r})"


def _is_secret(text: str) -> bool:
    return len(text) >= _SHORTEST_SECRET


def _parse_url(base_url: str) -> httpx.URL:
    try:
        url = httpx.URL(base_url.strip())
        usable = url.scheme in ("http", "https") and bool(url.host) and (url.port or 0) < 65536
    except (httpx.InvalidURL, ValueError):
        usable = False
    if not usable:
        raise ConfigError(
            "the base URL must look like http://127.0.0.1:8000/v1; "
            "change --base-url or OPENAI_BASE_URL"
        )
    return url


_NOT_IN_NAMES = re.compile(r"[^A-Za-z0-9_-]")
_MAX_NAME_CHARS = 64
"""Endpoints reject a conversation in which a tool has a name with other characters, or longer."""


def request_body(request: Request, model: str) -> dict[str, object]:
    """Build the body of a streamed request without fields that are None, empty or the default."""
    sampling = request.sampling
    body: dict[str, object] = {
        "model": model,
        "messages": _messages(request.messages),
        "stream": True,
        "stream_options": {"include_usage": True},
        "temperature": sampling.temperature,
        "top_p": sampling.top_p,
    }
    if sampling.max_tokens is not None:
        body["max_tokens"] = sampling.max_tokens
    if sampling.seed is not None:
        body["seed"] = sampling.seed
    if sampling.stop:
        body["stop"] = list(sampling.stop)
    if isinstance(form := sampling.response_format, JsonSchema):
        schema = {"name": form.name, "schema": form.content}
        body["response_format"] = {"type": "json_schema", "json_schema": schema}
    elif form != "text":
        body["response_format"] = {"type": form}
    if request.tools:
        body["tools"] = [_function(tool.model_dump()) for tool in request.tools]
    if isinstance(choice := request.tool_choice, NamedTool):
        body["tool_choice"] = _function({"name": choice.name})
    elif choice != "auto":
        body["tool_choice"] = choice
    return body


def _messages(messages: Iterable[Message]) -> list[dict[str, object]]:
    """The messages, with the images of tool results in a user message that follows the results.

    Tool messages hold only text, and nothing may stand between those that answer one reply.
    """
    sent: list[dict[str, object]] = []
    for are_results, group in groupby(messages, key=lambda message: message.role == "tool"):
        neighbours = list(group)
        sent += [_message(message) for message in neighbours]
        if are_results and (parts := _result_images(neighbours)):
            sent.append({"role": "user", "content": parts})
    return sent


def _message(message: Message) -> dict[str, object]:
    if message.role == "tool":
        return {"role": "tool", "content": message.text, "tool_call_id": message.tool_call_id}
    if message.images:
        return {"role": message.role, "content": _parts(message.text, message.images)}
    if message.tool_calls:
        calls = [_tool_call(call) for call in message.tool_calls]
        answer = {"role": message.role, "content": message.text or None, "tool_calls": calls}
        return {**answer, **message.extra}
    return {"role": message.role, "content": message.text}


def _result_images(results: Iterable[Message]) -> list[dict[str, object]]:
    return [
        part
        for result in results
        if result.images
        for part in _parts(f"The image of tool call {result.tool_call_id}:", result.images)
    ]


def _parts(text: str, images: Sequence[str]) -> list[dict[str, object]]:
    parts: list[dict[str, object]] = [{"type": "text", "text": text}]
    return parts + [{"type": "image_url", "image_url": {"url": url}} for url in images]


def _function(content: Mapping[str, object]) -> dict[str, object]:
    return {"type": "function", "function": content}


def _tool_call(call: ToolCall) -> dict[str, object]:
    """A call of an earlier reply, with a legal name and with arguments that are a JSON object.

    Many servers parse them to fill in a chat template, and reject the whole conversation otherwise.
    """
    name = _NOT_IN_NAMES.sub("_", call.name)[:_MAX_NAME_CHARS] or "_"
    arguments = call.arguments.strip() or "{}"
    if not is_json_object(arguments):
        arguments = json.dumps({"not_json": arguments})
    extra = {"extra_content": json.loads(call.extra_content)} if call.extra_content else {}
    return {"id": call.id, **_function({"name": name, "arguments": arguments}), **extra}

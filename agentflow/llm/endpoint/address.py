"""Owns where requests go and what may be shown of it: URL, model, key. Sends nothing itself.

The key is given to httpx and to `scrub`, and to nothing else.
"""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Generator

import httpx

from agentflow.errors import ConfigError

DEFAULT_BASE_URL = "https://api.openai.com/v1"
_SHORTEST_SECRET = 6
"""Shorter keys are placeholders for local servers ("EMPTY"), and words of ordinary text."""
_LOOKS_LIKE_A_KEY = re.compile(r"(?i)(?<=bearer )[\w.~+/*=-]{6,}|\bsk-[A-Za-z0-9_*.-]{6,}")


class _Bearer(httpx.Auth):
    """Adds the key at the moment of sending, so that no header object of ours holds it."""

    def __init__(self, key: str) -> None:
        self._key = key

    def auth_flow(self, request: httpx.Request) -> Generator[httpx.Request, httpx.Response, None]:
        request.headers["Authorization"] = f"Bearer {self._key}"
        yield request


class Endpoint:
    """One model at one base URL.

    Args:
        model: The model's name as the endpoint knows it.
        base_url: What precedes `/chat/completions`; a trailing slash does not matter.
        api_key: Sent as a bearer token; None or empty sends none.
        key_variable: The environment variable that the key comes from, for messages.

    Raises:
        ConfigError: The base URL is no http(s) URL, or the key cannot be a header.
    """

    def __init__(
        self,
        model: str,
        base_url: str = DEFAULT_BASE_URL,
        api_key: str | None = None,
        key_variable: str = "OPENAI_API_KEY",
    ) -> None:
        given = _parsed(base_url)
        bare = given.copy_with(username=None, password=None)
        key = (api_key or "").strip()
        if not (key.isascii() and key.isprintable()) or " " in key:
            raise ConfigError(f"{key_variable} holds characters that a key cannot have")
        self.model = model
        self.key_variable = key_variable
        self.has_key = bool(key)
        self.base_url = str(bare.copy_with(query=None, fragment=None)).rstrip("/")
        """As shown in messages: without credentials and query."""
        self.url = bare.copy_with(path=bare.path.rstrip("/") + "/chat/completions")
        basic = b64encode(f"{given.username}:{given.password}".encode()).decode()
        # A token may stand in a URL as the user, with no password or with any letter for one.
        proof = max(given.password, given.username, key=_is_secret)
        self._secrets = [secret for secret in (key, proof, basic) if _is_secret(secret)]
        self._auth: httpx.Auth | None = _Bearer(key) if key else None
        if self._auth is None and given.username:
            self._auth = httpx.BasicAuth(given.username, given.password)

    @property
    def auth(self) -> httpx.Auth | None:
        """How httpx proves who asks."""
        return self._auth

    def scrub(self, text: str) -> str:
        """The text without this endpoint's secrets, nor anything else that looks like a key."""
        return _LOOKS_LIKE_A_KEY.sub("***", self.scrub_known(text))

    def scrub_known(self, text: str) -> str:
        """The text without this endpoint's secrets, otherwise untouched (for replies)."""
        for secret in self._secrets:
            text = text.replace(secret, "***")
        return text

    def __repr__(self) -> str:
        return f"Endpoint(model={self.model!r}, base_url={self.base_url!r})"


def _is_secret(text: str) -> bool:
    return len(text) >= _SHORTEST_SECRET


def _parsed(base_url: str) -> httpx.URL:
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

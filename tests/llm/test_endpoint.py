"""Request URLs; the key is never shown."""

from __future__ import annotations

import httpx
import pytest

from agentflow.errors import ConfigError
from agentflow.llm.endpoint.body import Endpoint


@pytest.mark.parametrize(
    ("base_url", "shown", "target"),
    [
        ("http://h:8000/v1", "http://h:8000/v1", "http://h:8000/v1/chat/completions"),
        ("http://h:8000/v1/", "http://h:8000/v1", "http://h:8000/v1/chat/completions"),
        ("https://h", "https://h", "https://h/chat/completions"),
        ("https://u:secret@h/v1", "https://h/v1", "https://h/v1/chat/completions"),
        ("https://h/o/?v=2", "https://h/o", "https://h/o/chat/completions?v=2"),
    ],
)
def test_base_url_is_what_precedes_the_path(base_url: str, shown: str, target: str) -> None:
    endpoint = Endpoint("m", base_url)
    assert (endpoint.base_url, str(endpoint.url)) == (shown, target)


@pytest.mark.parametrize(
    "base_url", ["127.0.0.1:8000/v1", "ftp://h", "", "http://", "http://h:port", "x"]
)
def test_a_base_url_without_scheme_or_host_is_rejected(base_url: str) -> None:
    with pytest.raises(ConfigError) as caught:
        Endpoint("m", base_url)
    assert str(caught.value) == (
        "the base URL must look like http://127.0.0.1:8000/v1; change --base-url or OPENAI_BASE_URL"
    )


@pytest.mark.parametrize("key", ["two words", "line\nbreak", "schlüssel"])
def test_an_invalid_key_is_rejected_without_showing_it(key: str) -> None:
    with pytest.raises(ConfigError) as caught:
        Endpoint("m", "http://h", key, key_variable="OTHER_KEY")
    assert str(caught.value) == "OTHER_KEY contains characters not allowed in an API key"


def test_secrets_are_masked() -> None:
    endpoint = Endpoint("m", "http://user:pass-word@h", " abc123xyz \n")
    assert repr(endpoint) == "Endpoint(model='m', base_url='http://h')"
    text = "abc123xyz, pass-word, Bearer something, sk-foreign-key, disk-space-left"
    assert endpoint.scrub(text) == "***, ***, Bearer ***, ***, disk-space-left"
    assert endpoint.scrub_known(text).startswith("***, ***, Bearer something, sk-foreign-key")


@pytest.mark.parametrize("user", ["user:pass-word", "only-a-token", "gho_a-token:x"])
def test_credentials_in_a_base_url_are_masked_in_each_form(user: str) -> None:
    endpoint, proof = Endpoint("m", f"http://{user}@h"), user.removeprefix("user:").split(":")[0]
    assert isinstance(endpoint.auth, httpx.Auth)
    sent = next(endpoint.auth.auth_flow(httpx.Request("POST", endpoint.url)))
    scrubbed = endpoint.scrub_known(f"{sent.headers['authorization']}, {proof}")
    assert scrubbed == "Basic ***, ***"


def test_placeholder_keys_are_not_secrets() -> None:
    assert Endpoint("m", "http://h", "EMPTY").scrub_known("EMPTY") == "EMPTY"

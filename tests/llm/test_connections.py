"""Connections: one per concurrent call, reused, configured by the environment."""

from __future__ import annotations

import asyncio
import ssl
from pathlib import Path

import pytest
import trustme

from agentflow.errors import ConfigError
from agentflow.llm.endpoint.faults import TransientFault
from tests.llm.helpers import ask, client_for
from tests.llm.hostile import reply, serving


@pytest.mark.slow
async def test_concurrent_calls_have_one_connection_each_and_later_calls_reuse_it() -> None:
    async with serving(reply("x")) as server:
        client = client_for(server.base_url)
        for _ in range(4):
            await asyncio.gather(*[client.complete(ask()) for _ in range(100)])
        await client.aclose()
    assert len(server.asked) == 400
    # 64 connections are kept between the bursts; the other 36 are opened again.
    assert server.connections <= 100 + 3 * 36


async def test_a_proxy_from_the_environment_is_used_except_for_loopback(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with serving(reply("from the proxy"), reply("from the server")) as server:
        monkeypatch.setenv("HTTP_PROXY", server.base_url.removesuffix("/v1"))
        client = client_for("http://models.invalid/v1")
        assert (await client.complete(ask())).text == "from the proxy"
        await client.aclose()
        client = client_for(server.base_url)
        assert (await client.complete(ask())).text == "from the server"
        await client.aclose()
    assert [asked.target for asked in server.asked] == [
        "http://models.invalid/v1/chat/completions",
        "/v1/chat/completions",
    ]


def test_an_invalid_proxy_or_certificate_in_the_environment_is_reported(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    missing = tmp_path / "none.pem"
    for proxy in ("carrier-pigeon://roof", "http://user:password@roof:attic"):
        with monkeypatch.context() as environment:
            environment.setenv("HTTPS_PROXY", proxy)
            with pytest.raises(
                ConfigError, match=r"^invalid proxy or certificate settings in"
            ) as error:
                client_for("https://models.invalid/v1")
            assert "password" not in str(error.value)
    missing.write_text("no certificate")
    monkeypatch.setenv("SSL_CERT_FILE", str(missing))
    with pytest.raises(ConfigError, match=r"^invalid proxy or certificate settings in the env"):
        client_for("https://models.invalid/v1")


async def test_a_certificate_from_the_environment_is_trusted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    authority = trustme.CA()
    authority.cert_pem.write_to_path(tmp_path / "authority.pem")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    authority.issue_cert("127.0.0.1").configure_cert(context)
    async with serving(reply("in secret"), tls=context) as server:
        client = client_for(server.base_url)
        with pytest.raises(TransientFault, match="CERTIFICATE_VERIFY_FAILED"):
            await client.complete(ask())
        await client.aclose()
        monkeypatch.setenv("SSL_CERT_FILE", str(tmp_path / "authority.pem"))
        client = client_for(server.base_url)
        assert (await client.complete(ask())).text == "in secret"
        await client.aclose()

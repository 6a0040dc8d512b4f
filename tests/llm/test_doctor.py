"""Diagnoses of endpoints."""

from __future__ import annotations

import pytest

from agentflow.llm.build import EndpointDiagnosis, diagnose
from agentflow.llm.endpoint.body import Endpoint
from agentflow.llm.settings import HttpSettings
from tests.llm.helpers import KEY, ask
from tests.llm.hostile import body, reply, serving, silence


async def examined(base_url: str, key: str | None = KEY) -> EndpointDiagnosis:
    return await diagnose(
        Endpoint("m", base_url, key), HttpSettings(connect_s=10, idle_s=60), ask("hello", seed=1)
    )


@pytest.mark.slow
async def test_a_third_party_server(stub_url: str) -> None:
    found = await examined(stub_url)
    assert (found.reachable, found.authorised, found.model_exists) == (True, True, True)
    assert (found.streaming, found.usage, found.reasoning) == (True, False, False)
    assert (dict(found.refused), found.problem, found.answered_as) == ({}, "", "m")
    assert found.latency_s is not None
    assert found.latency_s > 0


async def test_a_server_with_limitations() -> None:
    refusal = body({"error": {"message": "unsupported parameter", "param": "seed"}}, 400)
    async with serving(refusal, reply("{}", reasoning="hm")) as server:
        found = await examined(server.base_url)
    assert dict(found.refused) == {"seed": "omitted"}
    assert (found.streaming, found.usage, found.reasoning) == (False, True, True)
    assert found.answered_as == "model-as-answered"


@pytest.mark.slow
async def test_problems_are_reported() -> None:
    async with serving(body("", 401), body("", 404), body("", 503)) as server:
        url = server.base_url
        refused, missing, busy = [await examined(url) for _ in range(3)]
        keyless = await examined(url, key=None)
    absent = await examined(url)
    assert (refused.reachable, refused.authorised, refused.model_exists) == (True, False, None)
    assert (missing.reachable, missing.authorised, missing.model_exists) == (True, True, False)
    assert (busy.reachable, busy.authorised) == (True, None)
    assert busy.problem == f"{url} is temporarily unavailable (503: no message)"
    assert keyless.problem == busy.problem
    assert (absent.reachable, absent.authorised) == (False, None)
    assert absent.problem.startswith(f"no answer from {url} (")


async def test_a_slow_endpoint_is_reachable() -> None:
    async with serving(silence) as server:
        settings = HttpSettings(connect_s=10, idle_s=0.2)
        found = await diagnose(Endpoint("m", server.base_url, KEY), settings, ask("hello", seed=1))
    assert (found.reachable, found.authorised) == (True, None)
    assert found.problem.startswith(f"no data for 0.2 s from {server.base_url}, which is connected")

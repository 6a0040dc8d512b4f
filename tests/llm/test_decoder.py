"""The client against a real decoder: transformers' server with a tiny model of random weights.

Optional, also in CI: `scripts/servers decoder` makes its environment.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from agentflow.errors import ModelNotFoundError
from agentflow.llm.build import diagnose
from agentflow.llm.endpoint.body import Endpoint
from agentflow.llm.endpoint.http import OpenAIClient
from agentflow.llm.messages import Reply, Usage
from agentflow.llm.settings import HttpSettings
from tests.llm.foreign import ROOT, foreign
from tests.llm.helpers import ask

ENVIRONMENT = ".venv-decoder"
PYTHON = ROOT / ENVIRONMENT / "bin" / "python"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not PYTHON.exists(), reason=f"{ENVIRONMENT} is missing: run scripts/servers decoder"
    ),
]


@pytest.fixture(scope="module")
def decoder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Endpoint]:
    """`transformers serve` with a model that was never trained, named tiny."""
    folder = tmp_path_factory.mktemp("decoder")
    script = Path(__file__).with_name("decoder.py")
    local = {"HF_HUB_OFFLINE": "1", "OMP_NUM_THREADS": "1"}
    subprocess.run([PYTHON, script, "tiny"], cwd=folder, env=local, check=True, timeout=120)
    arguments = ["-m", "transformers.cli.transformers", "serve", "tiny", "--device", "cpu"]
    arguments += ["--host", "127.0.0.1", "--port", "{port}"]
    with foreign(ENVIRONMENT, arguments, "/health", folder, local) as url:
        yield Endpoint("tiny", url)


async def reply_of(endpoint: Endpoint, *, streamed: bool, **sampling: object) -> Reply:
    """A reply, streamed or not."""
    client = OpenAIClient(endpoint, HttpSettings(), pytest.fail)
    if not streamed:
        client.unsupported.actions["stream"] = "omitted"  # as after a refusal
    try:
        reply = await client.complete(ask("hi there", seed=1, **sampling))
    finally:
        await client.aclose()
    assert client.streams is streamed
    return reply


async def test_a_decoder_answers_with_and_without_streaming(decoder: Endpoint) -> None:
    streamed = await reply_of(decoder, streamed=True, max_tokens=24)
    whole = await reply_of(decoder, streamed=False, max_tokens=24)
    for reply in (streamed, whole):
        assert (reply.finish, reply.model) == ("length", "tiny@main")
        assert reply.usage == Usage(prompt=len("hi there\n"), completion=24)
        assert len(reply.text) == 24
    assert streamed.text == whole.text  # drawn with the same seed


@pytest.mark.parametrize("streamed", [True, False])
async def test_a_decoder_stops_at_stop_words_and_limits(decoder: Endpoint, streamed: bool) -> None:
    stop = tuple("0123456789")
    reply = await reply_of(decoder, streamed=streamed, max_tokens=900, stop=stop)
    assert reply.finish == "stop"
    assert reply.usage.completion < 900


async def test_diagnosis_of_a_decoder(decoder: Endpoint) -> None:
    found = await diagnose(decoder, HttpSettings(), ask("hi", seed=1, max_tokens=32))
    assert (found.reachable, found.authorised, found.model_exists) == (True, True, True)
    assert (found.streaming, found.usage, found.reasoning) == (True, True, False)
    assert (dict(found.refused), found.answered_as) == ({}, "tiny@main")
    assert found.problem == "" or "cut off at 32 tokens" in found.problem  # by random weights


async def test_an_unknown_model_of_a_decoder(decoder: Endpoint) -> None:
    other = Endpoint("nonesuch", decoder.base_url)
    with pytest.raises(
        ModelNotFoundError, match=r"^model 'nonesuch' not found at .* \(400: Server is pin"
    ):
        await reply_of(other, streamed=True)

"""One bench over HTTP, on real physics: what clients of the SDK see of it."""

from __future__ import annotations

import base64
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from io import BytesIO

import anyio
import pytest
from mcp import Client, types
from mcp.shared.exceptions import MCPError
from PIL import Image

from agentflow.integrations.mcp.serving import serve_bench
from agentflow.tools import Bench
from tests.integrations.mcp.clients import data_of, http_client, text_of
from tests.tools.benches import CAR, open_bench


@asynccontextmanager
async def connected(**options: object) -> AsyncIterator[tuple[Client, Bench]]:
    """A client at a bench on the task `movement`."""
    async with (
        open_bench(**options) as (bench, _),  # type: ignore[arg-type]
        serve_bench(bench) as served,
        http_client(served.url, served.token) as client,
    ):
        yield client, bench


@pytest.mark.slow
async def test_tools_come_with_schemas_and_hints() -> None:
    async with connected() as (client, bench):
        tools = (await client.list_tools()).tools
        assert [tool.name for tool in tools] == [spec.name for spec in bench.tools]
        assert [tool.input_schema for tool in tools] == [spec.parameters for spec in bench.tools]
        reading = {
            tool.name for tool in tools if tool.annotations and tool.annotations.read_only_hint
        }
        assert reading == {"brief", "describe", "query", "look", "history"}
        told = client.instructions
        assert told is not None
        assert "`brief`" in told


@pytest.mark.slow
async def test_a_design_with_progress_picture_and_end() -> None:
    beats: list[float] = []
    told: list[str] = []

    async def note(progress: float, _total: float | None, message: str | None) -> None:
        beats.append(progress)
        told.append(message or "")

    async with connected(submissions=1) as (client, bench):
        checked = await client.call_tool("check", {"machine": CAR})
        name = data_of(checked)["machine"]
        assert text_of(checked).startswith(f"Machine {name}: valid")
        simulated = await client.call_tool("simulate", {"machine": name}, progress_callback=note)
        assert data_of(simulated)["score"] > 10
        assert beats[:1] == [0.0]
        assert beats == sorted(set(beats))
        counted = "0 of 1 simulations done, working for"
        assert set(told[1:]) <= {f"{counted} {n} s" for n in range(1, 300)}
        looked = await client.call_tool("look", {"machine": name, "view": "side"})
        picture = looked.content[1]
        assert isinstance(picture, types.ImageContent)
        assert picture.mime_type == "image/png"
        assert Image.open(BytesIO(base64.b64decode(picture.data))).size == (640, 480)
        submitted = await client.call_tool("submit", {"machine": name})
        assert not submitted.is_error
        assert text_of(submitted).endswith("there is nothing more to do here.")
        assert bench.ended
        late = await client.call_tool("brief", {})
        assert late.is_error
        assert text_of(late) == "This stage has ended; there is nothing more to do here."


WRONG_CALLS: list[tuple[str, dict[str, object], str]] = [
    ("nonsense", {}, "the tool 'nonsense' does not exist; the tools are brief, check"),
    ("simulate", {"machine": "deadbeef"}, "there is no machine 'deadbeef'; there is none yet"),
    ("check", {"machine": "{not json"}, "The machine is not valid:"),
    ("check", {"machine": "x" * 1_000_000}, "an argument has 1000000 characters; send at most"),
    (
        "check",
        {"machine": CAR, "shell": "rm"},
        "check takes machine, note, parent; shell: Extra inputs",
    ),
    ("edit", {}, "edit takes machine, script; machine is missing; script is missing"),
]


@pytest.mark.slow
async def test_wrong_calls_get_words() -> None:
    async with connected() as (client, _):
        for name, arguments, words in WRONG_CALLS:
            answer = await client.call_tool(name, arguments)
            assert answer.is_error
            assert words in text_of(answer)
            assert data_of(answer)["refused"] == text_of(answer)


@pytest.mark.slow
async def test_a_cancelled_call_stops_the_simulation_and_costs_nothing() -> None:
    async with connected() as (client, _):
        name = data_of(await client.call_tool("check", {"machine": CAR}))["machine"]
        with anyio.CancelScope() as scope:

            async def cancel(_progress: float, _total: float | None, _text: str | None) -> None:
                scope.cancel()

            await client.call_tool("simulate", {"machine": name}, progress_callback=cancel)
        assert scope.cancelled_caught
        told = await client.call_tool("brief", {})
        assert data_of(told)["simulations_left"] == 3
        simulated = data_of(await client.call_tool("simulate", {"machine": name}))
        assert simulated["simulations_left"] == 2


@pytest.mark.slow
async def test_resources_are_the_brief_and_the_machines() -> None:
    async with connected() as (client, bench):
        name = data_of(await client.call_tool("check", {"machine": CAR}))["machine"]
        listed = (await client.list_resources()).resources
        assert [str(item.uri) for item in listed] == ["task://brief", f"machine://{name}"]
        (brief,) = (await client.read_resource("task://brief")).contents
        assert isinstance(brief, types.TextResourceContents)
        assert brief.text == bench.brief_text
        (machine,) = (await client.read_resource(f"machine://{name}")).contents
        assert isinstance(machine, types.TextResourceContents)
        assert json.loads(machine.text) == json.loads(CAR)
        assert machine.mime_type == "application/json"
        (template,) = (await client.list_resource_templates()).resource_templates
        assert template.uri_template == "machine://{name}"
        for uri in ("machine://../../etc/passwd", "machine://deadbeef", "file:///etc/passwd"):
            with pytest.raises(MCPError, match="there is no resource"):
                await client.read_resource(uri)


@pytest.mark.slow
async def test_prompts_hold_the_brief_and_the_machine() -> None:
    async with connected() as (client, bench):
        assert [item.name for item in (await client.list_prompts()).prompts] == ["design", "refine"]
        name = data_of(await client.call_tool("check", {"machine": CAR}))["machine"]
        for prompt, arguments, part in (
            ("design", {}, "`submit` the best machine"),
            ("refine", {"machine": name}, f"Machine {name}"),
        ):
            (message,) = (await client.get_prompt(prompt, arguments)).messages
            assert isinstance(message.content, types.TextContent)
            assert part in message.content.text
            assert bench.brief_text in message.content.text
        for prompt, arguments, words in (
            ("refine", {}, "the prompts are `design` and `refine`"),
            ("other", {}, "the prompts are `design` and `refine`"),
            ("refine", {"machine": "deadbeef"}, "there is no machine 'deadbeef'"),
        ):
            with pytest.raises(MCPError, match=words):
                await client.get_prompt(prompt, arguments)


@pytest.mark.slow
async def test_a_stage_without_simulation_offers_fewer_tools() -> None:
    async with connected(rollouts=None, looks=None) as (client, _):
        names = [tool.name for tool in (await client.list_tools()).tools]
        assert names == ["brief", "check", "describe", "edit", "history", "submit"]

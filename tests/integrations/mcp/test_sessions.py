"""The command `agentflow mcp`: sessions over stdio and HTTP, and the runs that they leave."""

from __future__ import annotations

import asyncio
import json
import shutil
import signal
import sys
from asyncio.subprocess import PIPE, STDOUT
from pathlib import Path

import pytest
from mcp import Client, types

from agentflow.runs import read_events, read_result, state_of
from tests.integrations.mcp.clients import (
    CAR,
    ENVIRONMENT,
    MAIN,
    command,
    data_of,
    http_client,
    http_server,
    only_run,
    stdio_session,
    text_of,
)
from tests.integrations.mcp.test_answering import CALL, DEEP, MACHINE

pytestmark = pytest.mark.slow
SHORTER = "Remove 6"
"""A wheel of the car."""


async def design_a_car(client: Client) -> tuple[str, str]:
    """Design a car in five calls; its name and the last words."""
    told = await client.call_tool("brief", {})
    assert "Task: movement" in text_of(told)
    checked = await client.call_tool("check", {"machine": CAR})
    name = data_of(checked)["machine"]
    simulated = await client.call_tool("simulate", {"machine": name})
    assert data_of(simulated)["score"] >= 40
    asked = [{"id": 0, "duration": [0, 5], "properties": ["position"]}]
    answer = await client.call_tool("query", {"machine": name, "queries": asked})
    assert "Block 0" in text_of(answer)
    return name, text_of(await client.call_tool("submit", {"machine": name}))


async def carry_out(*arguments: str) -> str:
    """What a command prints, which must succeed."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", MAIN, *arguments, stdout=PIPE, stderr=STDOUT, env=ENVIRONMENT
    )
    told, _ = await process.communicate()
    assert process.returncode == 0, told.decode()
    return told.decode()


async def check_run(run: Path) -> None:
    """`show`, `report` and `replay` read a run of the test's client."""
    assert await carry_out("replay", str(run)) == "identical\n"
    assert "MCP client test 1" in await carry_out("show", str(run))
    page = run / "report.html"
    await carry_out("report", str(run), "--out", str(page))
    assert "MCP client test 1" in page.read_text(encoding="utf-8")


async def test_a_car_in_five_calls_over_stdio(tmp_path: Path) -> None:
    async with stdio_session(tmp_path) as (client, log):
        name, words = await design_a_car(client)
        run = only_run(tmp_path)
        result = read_result(run)
        both = f"a verified score of {result.verified_score:.2f} (plain: {result.score:.2f})"
        assert (
            f"The design is finished, with {both}, which holds in 8 of 8. It is in {run};" in words
        )
        late = await client.call_tool("simulate", {"machine": name})
        told = data_of(late)
        assert (told["score"], told["verified_score"]) == (result.score, result.verified_score)
        assert (told["run"], told["verifying"]) == (str(run), False)
        assert late.is_error
        assert text_of(late).startswith("The design is finished")
        resources = (await client.list_resources()).resources
        assert [item.name for item in resources] == ["brief", "events", name]
        (events,) = (await client.read_resource("run://events")).contents
        assert isinstance(events, types.TextResourceContents)
        assert events.text == (run / "events.jsonl").read_text(encoding="utf-8")
    assert result.score >= 40
    assert result.model == "MCP client test 1"
    assert [event.data["tool"] for event in read_events(run) if event.kind == "tool"] == [
        "brief", "check", "simulate", "query", "submit"
    ]  # fmt: skip
    assert log.read_text() == f"agentflow: MCP client test 1: {run}\n"
    await check_run(run)


async def test_after_the_end_reading_tools_still_answer_and_nothing_is_recorded(
    tmp_path: Path,
) -> None:
    async with stdio_session(tmp_path) as (client, _):
        name, words = await design_a_car(client)
        run = only_run(tmp_path)
        before = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
        reading = ["brief", "describe", "query", "look", "history"]
        assert ", ".join(f"`{tool}`" for tool in reading) in words
        assert [tool.name for tool in (await client.list_tools()).tools] == reading
        queries = [{"id": 0, "duration": [0, 0.1], "properties": ["position"]}]
        calls: dict[str, tuple[dict[str, object], str]] = {
            "brief": ({}, "Task: movement"),
            "describe": ({"machine": name}, "in the machine frame"),
            "query": ({"machine": name, "queries": queries, "interval": 0.01}, "Block 0"),
            "look": ({"machine": name, "time": 1}, "the recorded state nearest to 1 s"),
            "history": ({}, name),
        }
        for tool, (arguments, wanted) in calls.items():
            told = await client.call_tool(tool, arguments)
            assert not told.is_error
            assert wanted in text_of(told)
            assert "The design is finished" in text_of(told)
        unknown = await client.call_tool("describe", {"machine": "deadbeef"})
        assert unknown.is_error
        assert "there is no machine 'deadbeef'" in text_of(unknown)
        for tool in ("simulate", "verify", "submit"):
            assert (await client.call_tool(tool, {"machine": name})).is_error
    assert {path: path.read_bytes() for path in run.rglob("*") if path.is_file()} == before


async def test_a_client_that_leaves_without_an_answer_is_judged_by_its_best_simulation(
    tmp_path: Path,
) -> None:
    async with stdio_session(tmp_path) as (client, _):
        name = data_of(await client.call_tool("check", {"machine": CAR}))["machine"]
        edit = {"machine": name, "script": SHORTER}
        worse = data_of(await client.call_tool("edit", edit))["machine"]
        scores = [
            data_of(await client.call_tool("simulate", {"machine": machine}))["score"]
            for machine in (worse, name)
        ]
        assert scores[0] < scores[1]
        assert state_of(only_run(tmp_path)) == "running"
    run = only_run(tmp_path)
    assert read_result(run).score == scores[1]
    await check_run(run)


async def test_a_client_that_made_nothing_leaves_nothing(tmp_path: Path) -> None:
    async with stdio_session(tmp_path) as (client, _):
        await client.list_tools()
        await client.call_tool("brief", {})
        assert only_run(tmp_path).is_dir()
    assert not (tmp_path / "runs").exists()


async def test_a_run_that_cannot_be_written_leaves_no_traceback_in_the_log(tmp_path: Path) -> None:
    async with http_server(tmp_path) as (served, server):
        async with http_client(served.url, served.token) as client:
            await client.call_tool("check", {"machine": CAR})
            run = only_run(tmp_path)
            shutil.rmtree(run)
        server.send_signal(signal.SIGINT)
        await server.wait()


async def test_three_stages_change_the_tools(tmp_path: Path) -> None:
    changes = asyncio.Event()

    async def note(message: object) -> None:
        if isinstance(message, types.ToolListChangedNotification):
            changes.set()

    options = ("--stages", "--no-vision", "--rollouts", "6")
    async with stdio_session(tmp_path, *options, message_handler=note) as (client, _):
        tools = [tool.name for tool in (await client.list_tools()).tools]
        assert tools == ["brief", "check", "describe", "edit", "history", "submit"]
        name = data_of(await client.call_tool("check", {"machine": CAR}))["machine"]
        refused = await client.call_tool("simulate", {"machine": name})
        assert refused.is_error
        assert "is not on offer in this stage" in text_of(refused)
        for blind in range(2):
            assert changes.is_set() is False
            told = await client.call_tool("submit", {"machine": name, "last": True})
            assert "The next stage begins. Its tools: brief, check" in text_of(told), blind
        await asyncio.wait_for(changes.wait(), 10)
        assert "simulate" in [tool.name for tool in (await client.list_tools()).tools]
        again = await client.call_tool("simulate", {"machine": name})
        assert data_of(again)["known"]
        await client.call_tool("submit", {"machine": name, "last": True})
    result = read_result(only_run(tmp_path))
    assert [stage.valid for stage in result.stages] == [1, 1, 1]
    assert result.rollouts == 1
    await check_run(only_run(tmp_path))


async def test_clients_over_http_have_runs_of_their_own(tmp_path: Path) -> None:
    async with http_server(tmp_path) as (served, _):
        async with http_client(served.url, served.token) as one:
            name = data_of(await one.call_tool("check", {"machine": CAR}))["machine"]
            async with http_client(served.url, served.token) as other:
                unknown = await other.call_tool("describe", {"machine": name})
                assert text_of(unknown).startswith(f"there is no machine '{name}'")
                await design_a_car(other)
            await one.call_tool("simulate", {"machine": name})
        runs = sorted((tmp_path / "runs").iterdir())
        assert len(runs) == 2
    assert [read_result(run).score >= 40 for run in runs] == [True, True]
    calls = [sum(event.kind == "tool" for event in read_events(run)) for run in runs]
    assert sorted(calls) == [2, 6]


async def test_ending_the_server_completes_the_runs_of_its_clients(tmp_path: Path) -> None:
    async with (
        http_server(tmp_path) as (served, server),
        http_client(served.url, served.token) as client,
    ):
        name = data_of(await client.call_tool("check", {"machine": CAR}))["machine"]
        await client.call_tool("simulate", {"machine": name})
        server.send_signal(signal.SIGINT)
        await server.wait()
    assert read_result(only_run(tmp_path)).score >= 40


async def test_a_killed_server_and_a_hostile_name_leave_a_run_that_can_be_read(
    tmp_path: Path,
) -> None:
    hostile = types.Implementation(name="<script>1</script>\x1b[31m\n../../x", version="9" * 999)
    async with (
        http_server(tmp_path) as (served, server),
        http_client(served.url, served.token, client_info=hostile) as client,
    ):
        name = data_of(await client.call_tool("check", {"machine": CAR}))["machine"]
        await client.call_tool("simulate", {"machine": name})
        server.kill()
        await server.wait()
    run = only_run(tmp_path)
    assert state_of(run) == "stopped"
    author = "MCP client <script>1</script> [31m ../../x 9999999999999999999999999999"
    told = await carry_out("show", str(run))
    assert author in told
    page = run / "report.html"
    await carry_out("report", str(run), "--out", str(page))
    assert "<script>1</script>" not in page.read_text(encoding="utf-8")
    told = await carry_out("design", "--resume", str(run))
    assert f"{author} cannot be asked again; what it did counts" in told
    assert read_result(run).score >= 40
    assert await carry_out("replay", str(run)) == "identical\n"


GARBAGE = [b"{not json", b"[" * 100_000, b"\xff\xfe\x00", b'"text"']


async def test_every_line_on_stdin_gets_words(tmp_path: Path) -> None:
    server = await asyncio.create_subprocess_exec(
        *command("--out", str(tmp_path / "runs")),
        stdin=PIPE, stdout=PIPE, stderr=PIPE, env=ENVIRONMENT, limit=2**20
    )  # fmt: skip
    hello = {
        "protocolVersion": "2025-11-25",
        "capabilities": {},
        "clientInfo": {"name": "raw", "version": "1"},
    }
    requests: list[tuple[str, dict[str, object], str]] = [
        ("tools/call", {"name": "brief"}, "Invalid request parameters"),  # before the greeting
        ("initialize", hello, '"serverInfo"'),
        ("nonsense", {}, "Method not found"),
        ("tools/call", {"name": 5}, "Invalid request parameters"),
        ("tools/call", {"name": "check", "arguments": "text"}, "Invalid request parameters"),
        *[
            ("tools/call", {"name": "check", "arguments": {"machine": text}}, words)
            for text, words in (
                ("x" * 1_000_000, "an argument has 1000000 characters; send at most 200000"),
                ("[" * 100_000, "The machine is not valid"),
            )
        ],
    ]
    lines = [
        json.dumps({"jsonrpc": "2.0", "id": number, "method": method, "params": params}).encode()
        for number, (method, params, _) in enumerate(requests)
    ]
    assert server.stdin is not None
    assert server.stdout is not None
    unreadable = {"surrogate": MACHINE % '"\\ud800"', "deep": MACHINE % DEEP, "listed": "[1]"}
    lines += [(CALL % (f'"{name}"', given)).encode() for name, given in unreadable.items()]
    server.stdin.write(b"\n".join([*GARBAGE, b"", *lines, b""]))
    told = [(await server.stdout.readline()).decode() for _ in [*GARBAGE, *lines]]
    answers = {json.loads(line)["id"]: line for line in told}
    assert answers.keys() == {None, *range(len(requests)), *unreadable}
    for number, (_, _, words) in enumerate(requests):
        assert words in answers[number]
    rest, errors = await server.communicate(b"")  # which closes stdin
    assert (rest, server.returncode) == (b"", 0)
    assert "Traceback" not in "".join([*told, errors.decode()])

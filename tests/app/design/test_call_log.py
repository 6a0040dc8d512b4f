"""Runs on disk, with calls completing in any order and kills at any time."""

from __future__ import annotations

import asyncio
import json
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from agentflow.agents.base import AskContext
from agentflow.llm.build import wrap
from agentflow.llm.messages import Client
from agentflow.llm.settings import LimitSettings
from agentflow.llm.wrappers.budget import Budget
from agentflow.llm.wrappers.limits import LimitedClient, Limiter
from agentflow.llm.wrappers.record import CallLog, ReplayClient
from agentflow.runs import RunDirectory
from agentflow.workflows.base import WorkflowResult
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.settings import WorkflowSettings
from tests.scripted import ScriptedClient
from tests.workflows.fakes import BRIEF, PROMPTS, Author, Delayed, Shelf

SETTINGS = WorkflowSettings.model_validate(
    {"trajectories": 3, "search": {"rounds": 2, "width": 2, "request_rounds": 2}}
)
Written = dict[str, bytes]


def carry_out(folder: Path, chance: random.Random) -> tuple[WorkflowResult, RunDirectory, CallLog]:
    """A run on disk with replies and rollouts that take random times, several at once."""
    run = RunDirectory.create(folder, "run", {})
    call_log = CallLog(run.call_log, pytest.fail)
    limits = LimitSettings(concurrent=chance.choice([1, 2, 5, 16, None]))
    inner = LimitedClient(Delayed(ScriptedClient(Author(seed=4)), chance), Limiter(limits))
    client = wrap(inner, call_log=call_log, budget=Budget())
    return asyncio.run(conduct(client, run, Shelf(delays=chance))), run, call_log


async def conduct(client: Client, run: RunDirectory, shelf: Shelf) -> WorkflowResult:
    context = AskContext(client, PROMPTS, max_retry=3)
    return await WORKFLOWS["hierarchical"](BRIEF, lambda _role: context, shelf, SETTINGS, run, 0)


def written(run: RunDirectory) -> Written:
    """Every file of a run, with sorted lines and without timings."""
    found = {}
    for path in sorted(run.path.rglob("*")):
        if path.suffix == ".jsonl":
            items = [json.loads(line) for line in path.read_bytes().splitlines()]
            for item in items:
                item.pop("at", None)
                item.get("reply", {}).pop("latency_s", None)
            lines = sorted(json.dumps(item) for item in items)
            found[str(path.relative_to(run.path))] = "\n".join(lines).encode()
        elif path.is_file():
            found[str(path.relative_to(run.path))] = path.read_bytes()
    return found


@pytest.mark.slow
def test_completion_orders_give_the_same_run(tmp_path: Path) -> None:
    """`benchmarks/kills.py` tries fifty."""
    complete_in_orders(tmp_path, 12)


def complete_in_orders(tmp_path: Path, count: int) -> None:
    runs, results, orders = [], [], set()
    for seed in range(count):
        folder = tmp_path / str(seed)
        result, run, call_log = carry_out(folder, random.Random(seed))
        labels = [entry.request.label for entry in call_log.calls()]
        call_log.close()
        run.close()
        runs.append(written(run))
        results.append(result)
        orders.add(tuple(labels))
    assert all(result == results[0] for result in results)
    for name in runs[0]:
        assert len({files.get(name) for files in runs}) == 1, name
    assert all(files.keys() == runs[0].keys() for files in runs)
    assert len(orders) > 0.8 * count, "hardly any order was another"
    assert len(runs[0]["calls.jsonl"].splitlines()) > 40


@pytest.mark.slow
def test_a_replay_in_any_order_matches_the_recorded_run(tmp_path: Path) -> None:
    result, run, call_log = carry_out(tmp_path / "recorded", random.Random(1))
    recorded = written(run)
    run.close()
    again = RunDirectory.create(tmp_path / "again", "run", {})
    client = Delayed(ReplayClient(call_log, "scripted"), random.Random(2))
    assert asyncio.run(conduct(client, again, Shelf())) == result
    call_log.close()
    again.close()
    repeated = written(again)
    assert repeated.pop("run.yaml") == recorded.pop("run.yaml")
    recorded.pop("calls.jsonl")
    assert repeated == recorded


KILLED = """
import asyncio, os, random, sys
from pathlib import Path
from agentflow.llm.wrappers.record import RecordingClient
from agentflow.llm.messages import Request
from tests.scripted import ScriptedClient
from agentflow.llm.wrappers.record import CallLog
from tests.llm.helpers import ask

CALLS = 2000

class Slow(ScriptedClient):
    async def complete(self, request: Request):
        os.write(log, (request.label + "\\n").encode())
        await asyncio.sleep(random.random() * 0.02)
        return await super().complete(request)

async def main(folder):
    with CallLog(folder / "calls.jsonl", print) as call_log:
        print("started", flush=True)
        client = RecordingClient(Slow(lambda request: request.label * 300), call_log)
        numbers = iter(range(CALLS))
        async def worker():
            for number in numbers:
                await client.complete(ask(label=f"a/{number}"))
        await asyncio.gather(*[worker() for _ in range(8)])

folder = Path(sys.argv[1])
log = os.open(folder / sys.argv[2], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
asyncio.run(main(folder))
"""


@pytest.mark.slow
def test_after_kills_no_recorded_call_is_repeated_or_lost(tmp_path: Path) -> None:
    """`benchmarks/kills.py` kills thirty times."""
    kill_and_go_on(tmp_path, 8)


def kill_and_go_on(tmp_path: Path, kills: int) -> None:
    rng = random.Random(5)
    path, recorded = tmp_path / "calls.jsonl", b""
    command = [sys.executable, "-c", KILLED, str(tmp_path)]
    killed_at_work = 0
    for number in range(kills + 1):
        with subprocess.Popen(
            [*command, f"asked-{number}"], stdout=subprocess.PIPE, text=True
        ) as process:
            assert process.stdout is not None
            assert "started\n" in iter(process.stdout.readline, "")  # after what a cut line is told
            if number < kills:
                enough = len(recorded) + rng.randrange(150_000)
                while path.stat().st_size < enough and process.poll() is None:
                    time.sleep(0.001)
                process.kill()
        known = {json.loads(line)["request"]["label"] for line in recorded.splitlines()}
        asked = (tmp_path / f"asked-{number}").read_text().split()
        assert len(asked) == len(set(asked))
        assert not known & set(asked), "asked again although it was recorded"
        now = path.read_bytes()
        whole = now[: now.rindex(b"\n") + 1] if b"\n" in now else b""
        assert whole.startswith(recorded), "lost although it was recorded"
        killed_at_work += recorded != whole and process.returncode == -signal.SIGKILL
        recorded = whole
    assert process.returncode == 0
    assert killed_at_work > kills / 3
    with CallLog(path, pytest.fail, writable=False) as call_log:
        replies = {entry.request.label: entry.reply.text for entry in call_log.calls()}
        assert len(replies) == len(call_log)
    assert replies == {f"a/{i}": f"a/{i}" * 300 for i in range(2000)}

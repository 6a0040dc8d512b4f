"""Designs that the page starts and stops: each is a process `agentflow design` with its own run."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
import tempfile
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from secrets import token_hex
from typing import Any
from urllib.parse import urlsplit

from pydantic import Field

from agentflow.app.design.config import load_config, urls_with_credentials
from agentflow.app.design.plan import RunPlan
from agentflow.app.design.trust import unnamed
from agentflow.config.run import KEY_VARIABLE
from agentflow.env.tasks.registry import task_names
from agentflow.errors import UnknownNameError, UsageError
from agentflow.interpreter import python_command, python_environment
from agentflow.models.completion import PATH_STARTS
from agentflow.runs.reading import FILE_NAME
from agentflow.studio.answers import Arguments
from agentflow.studio.folder import RunFolder
from agentflow.study.session import Written
from agentflow.workflows.registry import WORKFLOWS

USUAL = "hierarchical"
"""The workflow that the form offers first."""
START_S, STOP_S = 120.0, 15.0
"""Seconds that a design has to create its run, and to end after it was interrupted."""
MOST = 8
"""Most designs at a time."""
KEPT = 4000
"""Characters of a process's last words that are kept."""
THIS_COMPUTER = ("127.0.0.1", "localhost", "::1")
"""Hosts that may get the key although only the form names them."""
_PROGRAM = "import sys; from agentflow.cli import main; sys.exit(main())"


class NewDesign(Arguments):
    """The form of a design."""

    task: str = Field(max_length=80)
    workflow: str = Field(USUAL, max_length=40)
    model: str = Field("", max_length=200)
    """"" is the default: AGENTFLOW_MODEL, else procedural."""
    base_url: str = Field("", max_length=400, pattern=r"^(https?://\S+)?$")
    seed: int = Field(0, ge=0, lt=2**31)
    trajectories: int | None = Field(None, ge=1, le=64)
    rounds: int | None = Field(None, ge=0, le=200)
    calls: int | None = Field(None, ge=1)
    """Most model calls."""
    tokens: int | None = Field(None, ge=1)
    """Most tokens."""
    machine: Written | None = None
    """Improve this machine instead of designing one."""

    @property
    def options(self) -> dict[str, Any]:
        """The configuration keys that are given."""
        given = {
            "task": self.task,
            "workflow": self.workflow,
            "seed": self.seed,
            "model.name": self.model or None,
            "model.base_url": self.base_url or None,
            "trajectories": self.trajectories,
            "search.rounds": self.rounds,
            "model.budget.calls": self.calls,
            "model.budget.tokens": self.tokens,
        }
        return {key: value for key, value in given.items() if value is not None}


def workflow_names() -> list[str]:
    """The workflows that a page may start: none that runs other programs."""
    names = [name for name, workflow in WORKFLOWS.items() if not workflow.runs_program]
    return sorted(names, key=lambda name: name != USUAL)


def require_possible(form: NewDesign) -> RunPlan:
    """The plan of this form; UsageError unless it can begin, without a path on this machine."""
    if form.task not in task_names():
        raise UnknownNameError("task", form.task, task_names())
    if form.workflow not in workflow_names():
        raise UnknownNameError("workflow", form.workflow, workflow_names())
    name = form.model
    if (
        name.startswith(PATH_STARTS)
        or Path(name or "-").is_absolute()
        or Path(name or "-").is_dir()
    ):
        raise UsageError("the studio cannot start models in folders; use agentflow design --model")
    start = {} if form.machine is None else {"settings.start": form.machine}
    config = load_config(None, (), {**form.options, **start})
    if urls_with_credentials(config):
        raise UsageError("the base URL has a user or a query; the key comes from the environment")
    here = urlsplit(form.base_url).hostname in THIS_COMPUTER
    if os.environ.get(KEY_VARIABLE) and form.base_url and not here:
        for host in unnamed(config.model, {}):
            raise UsageError(
                f"the studio would send your key to a host that you have named only here: {host}; "
                f"start it with OPENAI_BASE_URL={form.base_url}, or use agentflow design --base-url"
            )
    plan = RunPlan.of(config)
    plan.require_workflow()
    return plan


@dataclass
class _Started:
    """A process, and the end of what it has said."""

    process: Process
    said: str = ""

    def __post_init__(self) -> None:
        self.listening = asyncio.create_task(_listen(self))

    @property
    def running(self) -> bool:
        return self.process.returncode is None


class Designs:
    """The designs that this studio has started."""

    def __init__(self, folder: RunFolder, scratch: Path) -> None:
        """`scratch` is a private folder for machines to start from."""
        self._folder, self._scratch = folder, scratch
        self._started: dict[str, _Started] = {}
        self._starting = 0
        """Designs without a process yet."""

    @classmethod
    @asynccontextmanager
    async def open(cls, folder: RunFolder) -> AsyncIterator[Designs]:
        """Leaving the context interrupts every design that still runs; it can be resumed."""
        with tempfile.TemporaryDirectory() as scratch:
            designs = cls(folder, Path(scratch))
            try:
                yield designs
            finally:
                await asyncio.gather(*map(designs.stop, list(designs._started)))

    def told(self) -> list[dict[str, Any]]:
        """Every design: its run, whether its process runs, and what it said if it failed."""
        return [
            {
                "run": name,
                "running": started.running,
                "problem": started.said if started.process.returncode else "",
            }
            for name, started in self._started.items()
        ]

    async def start(self, form: NewDesign) -> str:
        """Start a design; the name of its run, which then exists.

        Raises:
            UsageError: The form is wrong, or the process ended without a run.
        """
        running = sum(started.running for started in self._started.values())
        if running + self._starting >= MOST:
            raise UsageError(f"{MOST} designs are running; stop one of them")
        self._starting += 1  # before anything is awaited, so that two requests cannot both be last
        try:
            plan = await asyncio.to_thread(require_possible, form)
            name = f"{plan.run_name}-{token_hex(2)}"
            started = self._started[name] = await self._spawn(name, form)
        finally:
            self._starting -= 1
        if not await _appears(self._folder.root / name, started):
            await self.stop(name)
            said = started.said.strip() or "the process ended without a word"
            del self._started[name]
            raise UsageError(said)
        return name

    async def stop(self, name: str) -> None:
        """Interrupt a design, and wait until it has ended.

        Raises:
            UsageError: This studio has not started it.
        """
        if name not in self._started:
            raise UsageError(f"this studio has not started {name[:80]!r}, so it cannot stop it")
        started = self._started[name]
        for ask in (_interrupt, Process.terminate, Process.kill):
            if not started.running:
                break
            with suppress(ProcessLookupError):
                ask(started.process)
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(started.process.wait(), STOP_S)
        await started.listening

    async def _spawn(self, name: str, form: NewDesign) -> _Started:
        options = ["--quiet", f"--out={self._folder.root}", f"--name={name}"]
        given = form.options.items()
        options += (f"--set={key}={json.dumps(value, ensure_ascii=False)}" for key, value in given)
        if form.machine is not None:
            file = self._scratch / f"{name}.json"
            file.write_text(json.dumps(form.machine), encoding="utf-8")
            options.append(f"--start={file}")
        process = await asyncio.create_subprocess_exec(
            *python_command(_PROGRAM, "design", *options),
            env=python_environment(),
            stdin=DEVNULL,
            stdout=DEVNULL,
            stderr=PIPE,
            start_new_session=True,
        )
        return _Started(process)


async def _listen(started: _Started) -> None:
    """Keep the end of what a process says, without its key, until it has ended."""
    assert started.process.stderr is not None
    while said := await started.process.stderr.read(4096):
        text = started.said + said.decode("utf-8", "replace")
        started.said = _without_key(text)[-KEPT:]
    await started.process.wait()


def _without_key(text: str) -> str:
    key = os.environ.get(KEY_VARIABLE, "").strip()
    return text.replace(key, "***") if len(key) > 5 else text


async def _appears(run: Path, started: _Started) -> bool:
    """Whether a run comes into being before its process ends."""
    for _ in range(int(START_S / 0.1)):
        if (run / FILE_NAME).is_file():
            return True
        if not started.running:
            await started.listening
            return (run / FILE_NAME).is_file()
        await asyncio.sleep(0.1)
    return False


def _interrupt(process: Process) -> None:
    process.send_signal(signal.SIGINT) if sys.platform != "win32" else process.terminate()

"""Designs that the page starts and stops: each is a process `agentflow design` with its own run."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from secrets import token_hex
from typing import Any

from agentflow.config.run import KEY_VARIABLE
from agentflow.errors import UsageError
from agentflow.runs.document import FILE_NAME
from agentflow.studio.folder import RunFolder
from agentflow.studio.watching.forms import NewDesign, require_possible

START_S, STOP_S = 120.0, 15.0
"""Seconds that a design has to create its run, and to end after it was interrupted."""
MOST = 8
"""Most designs at a time."""
KEPT = 4000
"""Characters of a process's last words that are kept."""
_PROGRAM = "import sys; from agentflow.cli import main; sys.exit(main())"


@dataclass
class _Started:
    """A process, and the end of what it has said."""

    process: asyncio.subprocess.Process
    listening: asyncio.Task[None]
    said: str = ""

    @property
    def running(self) -> bool:
        return self.process.returncode is None


class Designs:
    """The designs that this studio has started."""

    def __init__(self, folder: RunFolder, scratch: Path) -> None:
        """`scratch` is a private folder for machines to start from."""
        self._folder, self._scratch = folder, scratch
        self._started: dict[str, _Started] = {}

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
        if sum(started.running for started in self._started.values()) >= MOST:
            raise UsageError(f"{MOST} designs are running; stop one of them")
        await asyncio.to_thread(require_possible, form)
        stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
        task = form.task.replace("/", "-")
        name = f"{stamp}-{task}-{form.workflow}-seed{form.seed}-{token_hex(2)}"
        started = self._started[name] = await self._spawn(name, form)
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
        for ask in (_interrupt, _terminate, _kill):
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
            *(sys.executable, "-c", _PROGRAM, "design", *options),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE,
            start_new_session=True,
        )
        started = _Started(process, asyncio.create_task(asyncio.sleep(0)))
        started.listening = asyncio.create_task(_listen(started))
        return started


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


def _interrupt(process: asyncio.subprocess.Process) -> None:
    process.send_signal(signal.SIGINT) if sys.platform != "win32" else process.terminate()


def _terminate(process: asyncio.subprocess.Process) -> None:
    process.terminate()


def _kill(process: asyncio.subprocess.Process) -> None:
    process.kill()

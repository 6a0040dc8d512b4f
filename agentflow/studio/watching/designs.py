"""Designs that the page starts and stops: each is a process `agentflow design` with its own run."""

from __future__ import annotations

import asyncio
import inspect
import json
import os
import re
import signal
import sys
import tempfile
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from secrets import token_hex
from time import time
from typing import Any
from urllib.parse import urlsplit

from pydantic import Field, ValidationError

from agentflow.app.design.config import load_config, urls_with_credentials
from agentflow.app.design.plan import RunPlan
from agentflow.app.design.trust import unnamed
from agentflow.config.run import KEY_VARIABLE, build_config, changed_keys
from agentflow.env.tasks.registry import get_task, task_names
from agentflow.errors import UnknownNameError, UsageError
from agentflow.interpreter import python_command, python_environment
from agentflow.models.completion import PATH_STARTS
from agentflow.runs import read_document, state_of
from agentflow.runs.locations import Location
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
RETRYING = re.compile(r"(\S+): (.*); retrying in ([\d.]+) s")
"""A line about a call that is tried again: label, why, and seconds until then."""
SPOKEN = "\nagentflow: "
"""How a message on stderr begins."""
KEPT = 4000
"""Characters of a process's last words that are kept."""
THIS_COMPUTER = ("127.0.0.1", "localhost", "::1")
"""Hosts that may get the key although only the form names them."""
KEYS = {
    "model": "model.name",
    "base_url": "model.base_url",
    "rounds": "search.rounds",
    "calls": "model.budget.calls",
    "tokens": "model.budget.tokens",
    "machine": "start",
}
"""Field of the form -> configuration key, where they are named differently."""
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
        fields = self.model_dump(exclude={"machine"}).items()
        return {KEYS.get(name, name): value for name, value in fields if value not in (None, "")}


def workflow_names() -> list[str]:
    """The workflows that a page may start: none that runs other programs."""
    names = [name for name, workflow in WORKFLOWS.items() if not workflow.runs_program]
    return sorted(names, key=lambda name: name != USUAL)


@lru_cache
def workflows_of_families() -> dict[str, dict[str, str]]:
    """Family of tasks -> the workflows that a page may start on them, and what each does."""
    briefs = {name: get_task(name).brief for name in task_names() if "/" not in name}
    known = [(name, WORKFLOWS[name]) for name in workflow_names()]
    return {
        task: {name: _about(each.stages) for name, each in known if each.fits(brief)}
        for task, brief in briefs.items()
    }


def _about(stages: object) -> str:
    """What a workflow does: the first paragraph about its stages, in plain text."""
    return " ".join((inspect.getdoc(stages) or "").split("\n\n")[0].replace("`", "").split())


def require_possible(form: NewDesign) -> RunPlan:
    """The plan of this form; UsageError unless it can begin, without a path on this machine."""
    if form.task not in task_names():
        raise UnknownNameError("task", form.task, task_names())
    if form.workflow not in workflow_names():
        raise UnknownNameError("workflow", form.workflow, workflow_names())
    if _is_folder(form.model):
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


def _is_folder(model: str) -> bool:
    path = Path(model or "-")
    return model.startswith(PATH_STARTS) or path.is_absolute() or path.is_dir()


def form_of(document: Mapping[str, Any]) -> dict[str, Any]:
    """The `form` that repeats a run with the next seed, from its run.yaml, and what is `left`: the
    keys and values that the form cannot hold."""
    config = build_config(document.get("config"))
    left = changed_keys(config)
    if config.engine != RunPlan.of(load_config(None, (), {})).config.engine:
        left["engine"] = config.engine
    form: dict[str, Any] = {
        "task": config.task,
        "workflow": config.workflow,
        "model": config.model.name,
        "base_url": config.model.base_url,
        "seed": config.seed + 1,
    }
    for name in NewDesign.model_fields:
        if (key := KEYS.get(name, name)) in left:
            form[name] = left.pop(key)
    unfit = {"task": config.task not in task_names(), "model": _is_folder(config.model.name)}
    unfit["workflow"] = config.workflow not in workflow_names()
    form = {name: value for name, value in form.items() if value is not None}
    try:
        NewDesign.model_validate(form)
    except ValidationError as error:
        unfit |= {str(item["loc"][0]): True for item in error.errors()}
    for name in (name for name, is_so in unfit.items() if is_so):
        left[KEYS.get(name, name)] = form.pop(name)
    return {"form": form, "left": left}


@dataclass
class _Started:
    """A process, and the end of what it has said."""

    process: Process
    form: NewDesign | None = None
    """None for a run that was resumed."""
    said: str = ""
    retries: int = 0
    """Calls that were tried again."""
    retry: str = ""
    """Which the last of them was, and why."""
    until: float = 0.0
    """When that is tried again, seconds since 1970."""
    stopped: bool = False
    """Whether somebody has stopped it."""
    begun: float = field(default_factory=time)

    def __post_init__(self) -> None:
        self.listening = asyncio.create_task(_listen(self))

    @property
    def running(self) -> bool:
        return not self.listening.done()

    @property
    def problem(self) -> str:
        """Why it failed; "" if it did not, or not yet."""
        if self.running or self.stopped or not self.process.returncode:
            return ""
        return self.said.rpartition(SPOKEN)[2].strip() or "the process ended without a word"

    def hear(self, line: str) -> None:
        """Take in a line of what the process says, without its key."""
        told = for_page(line)
        if found := RETRYING.fullmatch(told.removeprefix(SPOKEN.strip() + " ")):
            self.retries, self.until = self.retries + 1, time() + float(found[3])
            self.retry = f"{Location.parse(found[1]).words}: {found[2]}"
        else:
            self.said = f"{self.said}\n{told}"[-KEPT:]


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
        """Every design: its run, whether its process runs, why it failed, and its form."""
        return [
            {
                "run": name,
                "running": started.running,
                "problem": started.problem,
                "form": started.form and started.form.model_dump(exclude_unset=True),
            }
            for name, started in self._started.items()
        ]

    def again(self, name: str) -> dict[str, Any]:
        """`form_of` a run; of one that this studio has started, the form as it was."""
        known = self._started.get(name)
        if known and known.form:
            return {"form": known.form.model_dump(exclude_unset=True), "left": {}}
        return form_of(read_document(self._folder.run(name)))

    def failed(self) -> dict[str, dict[str, Any]]:
        """Name -> what is known of each design that failed, as a row of the list of runs."""
        form = ("task", "workflow", "model", "seed")
        nothing = dict.fromkeys((*form, "score", "verified", "share", "sweep", "machine"))
        return {
            name: {
                **nothing,
                **(started.form.model_dump(include=set(form)) if started.form else {}),
                "run": name,
                "state": "failed",
                "problem": started.problem,
                "calls": 0,
                "begun": started.begun,
                "seconds": 0.0,
                "curve": [],
                "fragile": False,
            }
            for name, started in self._started.items()
            if started.problem
        }

    def problem(self, name: str) -> str:
        """Why a design failed; "" if it did not, or if this studio has not started it."""
        return self._started[name].problem if name in self._started else ""

    def retries(self, name: str) -> dict[str, Any]:
        """How many calls of a design were tried again, which the last one was and why, and when it
        is tried again."""
        known = self._started.get(name)
        told = (known.retries, known.retry, known.until) if known else (0, "", 0.0)
        return dict(zip(("count", "last", "until"), told, strict=True))

    async def end_of(self, name: str) -> str:
        """The same once its process has ended, which it does soon after its run is gone."""
        if name in self._started:
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(asyncio.shield(self._started[name].listening), STOP_S)
        return self.problem(name)

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
            said = started.problem or "it did not begin in time"
            del self._started[name]
            raise UsageError(said)
        return name

    async def resume(self, name: str) -> None:
        """Continue a run that has stopped.

        Raises:
            UsageError: It is running or complete, or needs what only the command line may allow.
            RunError: There is no such run.
        """
        path = self._folder.run(name)
        if state_of(path) != "stopped":
            raise UsageError(f"{name} is not stopped, so it cannot be resumed")
        known = self._started.get(name)
        form = known.form if known else None
        config = build_config(read_document(path).get("config"))
        named = {"model": {"base_url": form.base_url}} if form else {}
        hosts = (host.split()[0] for host in unnamed(config.model, named))
        foreign = [host for host in hosts if urlsplit(host).hostname not in THIS_COMPUTER]
        if foreign or config.workflow not in workflow_names():
            what = f"sends prompts to {foreign[0]}" if foreign else "runs other programs"
            raise UsageError(
                f"this run {what}, which the studio does not do unasked: continue it in a terminal "
                f"with agentflow design --resume {path}"
            )
        options = [f"--resume={path}", "--trust"]
        self._started[name] = _Started(await _begin_process(options), form)

    async def stop(self, name: str) -> None:
        """Interrupt a design, and wait until it has ended.

        Raises:
            UsageError: This studio has not started it.
        """
        if name not in self._started:
            raise UsageError(f"this studio has not started {name[:80]!r}, so it cannot stop it")
        started = self._started[name]
        started.stopped = started.running
        for ask in (_interrupt, Process.terminate, Process.kill):
            if not started.running:
                break
            with suppress(ProcessLookupError):
                ask(started.process)
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(asyncio.shield(started.listening), STOP_S)
        await started.listening

    async def _spawn(self, name: str, form: NewDesign) -> _Started:
        options = [f"--out={self._folder.root}", f"--name={name}"]
        given = form.options.items()
        options += (f"--set={key}={json.dumps(value, ensure_ascii=False)}" for key, value in given)
        if form.machine is not None:
            file = self._scratch / f"{name}.json"
            file.write_text(json.dumps(form.machine), encoding="utf-8")
            options.append(f"--start={file}")
        return _Started(await _begin_process(options), form)


async def _begin_process(options: list[str]) -> Process:
    return await asyncio.create_subprocess_exec(
        *python_command(_PROGRAM, "design", *options),
        env=python_environment(),
        stdin=DEVNULL,
        stdout=DEVNULL,
        stderr=PIPE,
        start_new_session=True,
    )


async def _listen(started: _Started) -> None:
    """Keep the end of what a process says until it has ended."""
    assert started.process.stderr is not None
    rest = ""
    while said := await started.process.stderr.read(4096):
        *lines, rest = (rest + said.decode("utf-8", "replace")).split("\n")
        for line in lines:
            started.hear(line)
    started.hear(rest)
    await started.process.wait()


def for_page(text: str) -> str:
    """A text without the key of endpoints, with fields of the form in place of options."""
    key = os.environ.get(KEY_VARIABLE, "").strip()
    text = text.replace(key, "***") if len(key) > 5 else text
    return text.replace("--base-url", "Base URL").replace("--model", "Model")


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

"""The workflow `external`: in each stage, a program works at the bench and in a folder."""

import os
import shlex
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from itertools import dropwhile
from pathlib import Path
from tempfile import mkdtemp

from agentflow.errors import ConfigError, RunError
from agentflow.extras import needs_extra
from agentflow.integrations.external.folder import (
    MACHINES,
    TASK,
    TOKEN,
    URL,
    Assignment,
    MachineFile,
    read_machine_files,
    remove_folder,
    write_folder,
)
from agentflow.integrations.external.process import Ending, ProgramCommand, run_program
from agentflow.integrations.external.sandbox import is_isolated, isolated
from agentflow.runs.events import FilesEvent, FileVerdict, ProgramEvent, RunEvent
from agentflow.runs.locations import Location, StageName
from agentflow.tools import Bench
from agentflow.workflows.base import WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import ExternalSettings, WorkflowSettings
from agentflow.workflows.tools import count_rollouts, repeat, submit_each, work_in_stages
from agentflow.workflows.workflow import Workflow

_HARMLESS = """
    PATH HOME USER LOGNAME SHELL TERM LANG LANGUAGE TZ TMPDIR TEMP TMP
    XDG_CONFIG_HOME XDG_CACHE_HOME XDG_DATA_HOME XDG_STATE_HOME XDG_RUNTIME_DIR
    HTTP_PROXY HTTPS_PROXY ALL_PROXY http_proxy https_proxy all_proxy
    SSL_CERT_FILE SSL_CERT_DIR CURL_CA_BUNDLE REQUESTS_CA_BUNDLE NODE_EXTRA_CA_CERTS
    SYSTEMROOT SYSTEMDRIVE WINDIR COMSPEC PATHEXT USERNAME USERPROFILE HOMEDRIVE HOMEPATH
    APPDATA LOCALAPPDATA PROGRAMDATA PROGRAMFILES
"""
PASSED = frozenset(_HARMLESS.split())
"""Variables that every program gets, besides LC_*: what programs need to start, to find the files
of their user and to reach the network. No key is among them."""
NO_PROXY = ("NO_PROXY", "no_proxy")
LOOPBACK = "127.0.0.1"


def command_words(settings: ExternalSettings) -> list[str]:
    """The program, by its absolute path, and its arguments.

    Raises:
        ConfigError: There is none, it is not found, or it is not executable.
    """
    words = _split(settings)
    if not words:
        raise ConfigError(
            "external.command is empty, but the workflow external runs a program; name it, for "
            "example with --set external.command='claude -p'"
        )
    return [_find(words[0]), *words[1:]]


def _split(settings: ExternalSettings) -> list[str]:
    command = settings.command
    if settings.shell:
        if not isinstance(command, str):
            raise ConfigError("external.command: with external.shell, give one line, not a list")
        shell = ["cmd", "/c"] if sys.platform == "win32" else ["/bin/sh", "-c"]
        return [*shell, command] if command.strip() else []
    if not isinstance(command, str):
        return list(command)
    try:
        return shlex.split(command)
    except ValueError as error:
        raise ConfigError(
            f"external.command: {command!r} cannot be split into words: {error}; close the "
            "quotation, or give a list of words"
        ) from None


def _find(program: str) -> str:
    """The absolute path of a program."""
    found = shutil.which(program)
    if found is not None:
        return os.path.abspath(found)
    if os.path.dirname(program):
        if Path(program).is_file():
            raise ConfigError(
                f"external.command: {program} is not executable; run chmod +x on it, or "
                "put its interpreter before it"
            )
        raise ConfigError(f"external.command: there is no program {program}; check its path")
    raise ConfigError(
        f"external.command: no program {program!r} is on the PATH; install it, or give its path"
    )


def program_environment(
    settings: ExternalSettings, environ: Mapping[str, str], bench: Mapping[str, str]
) -> dict[str, str]:
    """The variables of a program: those in `PASSED`, those that the settings name, and `bench`.

    Raises:
        ConfigError: The settings name one that is not set.
    """
    for name in settings.variables:
        if name not in environ:
            raise ConfigError(
                f"external.variables names {name}, which is not set; set it, or remove the name"
            )
    passed = {
        name: value
        for name, value in environ.items()
        if name in PASSED or name.startswith("LC_") or name in settings.variables
    }
    around = [environ[name] for name in NO_PROXY if environ.get(name)][:1]
    direct = ",".join([*around, LOOPBACK])  # the bench is never behind a proxy
    return {**passed, **dict.fromkeys(NO_PROXY, direct), **bench}


LONGEST = 300
"""Most characters of a problem in the record."""


async def external(run: WorkflowContext) -> WorkflowResult:
    """Run the program once in each stage."""
    return await work_in_stages(run, partial(work, run))


async def work(run: WorkflowContext, bench: Bench, stage: StageName) -> None:
    """Run the program for a stage, then hand in the machines that it left in files.

    What an earlier process has recorded of the stage is done again from the record; the program
    runs only if the stage was not over.
    """
    told = await _repeat(run, bench, stage)
    if not told and not bench.ended:
        told = await _work(run, bench, stage)
    bench.end("; ".join(filter(None, map(str, told))))


async def _repeat(run: WorkflowContext, bench: Bench, stage: StageName) -> Sequence[RunEvent]:
    """Do again what is recorded of a stage; how it ended, or nothing if it did not."""
    earlier = await repeat(run, bench, stage)
    if not any(isinstance(event, FilesEvent) for event in earlier):
        return []
    told = [event for event in earlier if isinstance(event, ProgramEvent | FilesEvent)]
    for event in told:
        run.note(event)
    return told


async def _work(run: WorkflowContext, bench: Bench, stage: StageName) -> Sequence[RunEvent]:
    """Run the program and hand in its files; how it ended."""
    with _folder(stage) as folder:
        ending = await _run(run, bench, stage, folder)
        program = ProgramEvent(
            Location(stage), ending.status, ending.timed_out, is_isolated(run.settings.external)
        )
        run.note(program)
        found = read_machine_files(folder / MACHINES)
    verdicts = []
    for file in found.read:
        if bench.ended:
            break
        verdicts.append(await _hand_in(bench, file))
    more = len(found.read) - len(verdicts) + found.more
    files = FilesEvent(Location(stage), tuple(verdicts), more, found.problem)
    run.note(files)
    return [program, files]


@contextmanager
def _folder(stage: StageName) -> Iterator[Path]:
    """An empty folder for a stage, outside the run, which is gone afterwards."""
    temporary = Path(os.path.realpath(mkdtemp(prefix="agentflow-")))
    folder = temporary / stage
    folder.mkdir()
    try:
        yield folder
    finally:
        with suppress(OSError):  # such as a file of another user
            remove_folder(temporary)


async def _run(run: WorkflowContext, bench: Bench, stage: StageName, folder: Path) -> Ending:
    """Serve the bench while the program runs in its folder."""
    from agentflow.integrations.mcp.serving import serve_bench

    settings = run.settings.external
    words = command_words(settings)
    async with serve_bench(bench) as served:
        variables = {URL: served.url, TOKEN: served.token}
        environment = program_environment(settings, os.environ, variables)
        write_folder(folder, _assignment(run, bench, stage), served.url, served.token)
        alone = is_isolated(settings)
        how = "isolated" if alone else "not isolated"
        run.log(f"=== {stage}: {shlex.join(words)} ({how})\n".encode())
        around = isolated(settings, words, folder, served.url) if alone else nullcontext(words)
        try:
            async with around as all_words:
                command = ProgramCommand(all_words, environment, TOKEN, settings.limit_s)
                ending = await run_program(command, folder, folder / TASK, run.log)
        except OSError as error:
            kind = RunError if run.rollouts else ConfigError  # which leaves no run behind
            raise kind(f"external.command: cannot run {words[0]}: {error.strerror}") from None
    told = "stopped at its limit" if ending.timed_out else "ended"
    run.log(f"\n=== {stage}: {told} with status {ending.status}\n".encode())
    return ending


def _assignment(run: WorkflowContext, bench: Bench, stage: StageName) -> Assignment:
    start = run.settings.start_machine
    before = {
        known.name: known.machine
        for known in bench.machines
        if known.submitted not in (None, stage) or known.machine == start
    }
    return Assignment(stage, bench.brief_text, bench.tools, run.settings.external.limit_s, before)


async def _hand_in(bench: Bench, file: MachineFile) -> FileVerdict:
    """Check and submit the machine in a file."""
    if file.text is None:
        return FileVerdict(file.name, None, file.problem)
    checked = await bench.call("check", {"machine": file.text})
    if checked.refused:
        return FileVerdict(file.name, None, checked.text[:LONGEST])
    name = checked.data["machine"]
    submitted = await bench.call("submit", {"machine": name})
    return FileVerdict(file.name, name, submitted.text[:LONGEST] if submitted.refused else "")


def require_program(settings: WorkflowSettings) -> None:
    """Raise ConfigError unless the program can be run and the tools can be served to it."""
    command_words(settings.external)
    is_isolated(settings.external)
    program_environment(settings.external, os.environ, {})
    with needs_extra("mcp"):
        import agentflow.integrations.mcp.serving  # noqa: F401


def _author(settings: WorkflowSettings) -> str:
    """The program with its subcommand or script, if it has one: "program codex exec".

    Variables that a shell line sets before the program, such as keys, are left out.
    """
    command = settings.external.command
    given = command.split() if isinstance(command, str) else command
    words = [*dropwhile(lambda word: "=" in word, given)]
    named = [Path(word).name for word in words[:2] if not word.startswith("-")]
    return " ".join(["program", *named])


EXTERNAL = Workflow(
    "external",
    external,
    calls=lambda _: {},
    rollouts=count_rollouts,
    adapt=submit_each,
    author=_author,
    require=require_program,
    runs_program=True,
)

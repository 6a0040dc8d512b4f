"""What is written in README, docs and examples is true: commands and code.

`console` fences are carried out as they stand, with the built-in model; a command whose output is
shown must print it. `sh` fences need what a test has not (an endpoint, an installation): their
commands must be such as the command line understands. A fence with a `title` shows a file: an
excerpt of one in the repository, or a new one, which is there before the commands are run.
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from agentflow.cli import command_group, main
from agentflow.env.tasks.registry import get_task, task_names
from agentflow.machine import check
from agentflow.machine.formats.detect import read_any
from tests.loops import for_each

ROOT = Path(__file__).parent.parent
PAGES = sorted(
    path.relative_to(ROOT).as_posix()
    for pattern in ("README.md", "CONTRIBUTING.md", "docs/**/*.md", "examples/*.md", "recipes/*.md")
    for path in ROOT.glob(pattern)
)
NEEDED = (
    *("benchmarks", "examples", "configs", "docs"),
    *("runs/recorded-throwing", "runs/language-model-throwing"),
)
"""What commands may refer to, from the root of the repository."""
WITH_PACKAGE = {"docs/tutorials/your-own-part.md": "examples/straight"}
"""Pages whose commands need a package of the examples."""
ELSEWHERE = ("docs/tutorials/train-a-model.md",)
"""Pages whose commands tests/training runs, with PyTorch."""


@dataclass(frozen=True)
class Command:
    """One documented command line, and what it is shown to print ("" where nothing is shown)."""

    line: str
    output: str = ""

    @property
    def words(self) -> list[str]:
        return shlex.split(self.line, comments=True)


def fences(page: str, language: str) -> list[str]:
    text = (ROOT / page).read_text()
    return re.findall(rf"(?ms)^```{language}\n(.*?)^```$", text)


def titled(page: str) -> list[tuple[str, str]]:
    """The fences with a title: name of the file, and text."""
    text = (ROOT / page).read_text()
    return re.findall(r'(?ms)^```\w+ title="([^"]+)"\n(.*?)^```$', text)


def shown(page: str) -> list[Command]:
    """The commands of `console` fences."""
    entries = [e for block in fences(page, "console") for e in f"\n{block}".split("\n$ ")[1:]]
    split = (entry.rstrip("\n").partition("\n") for entry in entries)
    return [Command(line, output + "\n" if output else "") for line, _, output in split]


def understood(page: str) -> Iterator[Command]:
    """Every command of ours, from `console` and `sh` fences."""
    lines = [line for block in fences(page, "sh") for line in block.splitlines()]
    for command in [*shown(page), *map(Command, lines)]:
        if command.words and command.words[0] == "agentflow":
            yield command


def long(page: str) -> bool:
    """Whether its commands run physics."""
    quick = {"check", "edit", "convert", "tasks", "blocks", "config", "prompts"}
    return any(
        command.words[0] == "python" or command.words[1] not in quick
        for command in shown(page)
        if command.words[0] != "echo"
    )


def marks(page: str) -> list[pytest.MarkDecorator]:
    """Pages that run physics are slow; those that show a score show PyBullet's."""
    scores = any("pybullet" in command.output for command in shown(page))
    return [
        *([pytest.mark.slow] if long(page) else ()),
        *([pytest.mark.pybullet] if scores else ()),
    ]


WITH_COMMANDS = [
    pytest.param(page, marks=marks(page)) for page in PAGES if shown(page) and page not in ELSEWHERE
]
ALL = [(page, command) for page in PAGES for command in understood(page)]


def test_there_is_something_to_test() -> None:
    assert len(WITH_COMMANDS) >= 8
    assert len(ALL) >= 50


def parse(words: list[str]) -> None:
    """Have the command line read arguments, and do nothing."""
    command = command_group()
    context = command.make_context("agentflow", words)
    while hasattr(command, "resolve_command"):
        rest = [*context._protected_args, *context.args]
        name, command, rest = command.resolve_command(context, rest)
        assert command is not None
        context = command.make_context(name, rest, parent=context)


@for_each(ALL)
def test_the_command_line_understands_it(page: str, command: Command) -> None:  # noqa: ARG001
    parse(command.words[1:])


@pytest.mark.timeout(1200)
@pytest.mark.parametrize("page", WITH_COMMANDS)
def test_commands_run_as_written(
    page: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    follow(page, tmp_path, monkeypatch, capfd)


def follow(
    page: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Do in a folder what a page says."""
    for name in NEEDED:
        shutil.copytree(ROOT / name, folder / name)
    for name, text in titled(page):
        if not (ROOT / name).exists():
            (folder / name).write_text(text)
    monkeypatch.chdir(folder)
    for name in ("AGENTFLOW_MODEL", "OPENAI_BASE_URL", "OPENAI_API_KEY"):
        monkeypatch.delenv(name, raising=False)
    package = WITH_PACKAGE.get(page)
    if package:
        offer(folder / package)
        monkeypatch.setenv("PYTHONPATH", str(folder / package))
    for command in shown(page):
        status = run(command.words, in_process=package is None)
        printed, complaints = capfd.readouterr()
        assert status == 0, (command.line, complaints)
        assert command.output in ("", printed), command.line


def offer(package: Path) -> None:
    """Have the entry points of a package found, as pip would, but without building a wheel."""
    code = "import setuptools; setuptools.setup()"
    command = [sys.executable, "-W", "ignore", "-c", code, "-q", "egg_info"]
    subprocess.run(command, cwd=package, check=True)


def run(words: list[str], *, in_process: bool = True) -> int:
    """A command of ours, a Python script, or `echo TEXT > FILE`.

    Registries of this process know only what was installed when it began; another process sees
    what is on its path.
    """
    if words[0] == "agentflow" and in_process:
        return main(words[1:])
    if words[0] == "agentflow":
        code = "import sys; from agentflow.cli import main; sys.exit(main())"
        words = ["python", "-c", code, *words[1:]]
    if words[0] == "python":
        return subprocess.run([sys.executable, *words[1:]], check=False).returncode
    echo, text, arrow, file = words
    assert echo == "echo"
    with Path(file).open({">": "w", ">>": "a"}[arrow]) as target:
        target.write(text + "\n")
    return 0


@for_each(PAGES)
def test_files_that_are_shown_are_those_of_the_repository(page: str) -> None:
    for name, text in titled(page):
        if (ROOT / name).exists():
            assert text in (ROOT / name).read_text(), name


FOREIGN = ("docs/how-to/mcp.md", *(page for page in PAGES if "/integrations/" in page))
"""Their code needs other libraries or programs; the tests in tests/integrations run it."""


@pytest.mark.parametrize(
    "page", [page for page in PAGES if fences(page, "python") if page not in FOREIGN]
)
def test_python_runs(page: str) -> None:
    code = "".join(fences(page, "python"))
    assert "assert" in code
    exec(compile(code, page, "exec"), {})


def test_machines_that_are_shown_are_valid() -> None:
    machines = fences("docs/reference/machine-language.md", "json")
    assert len(machines) == 4
    for text in machines:
        assert check(read_any(text)).machine_valid


@for_each(PAGES)
def test_every_fence_says_what_it_is(page: str) -> None:
    opened = re.findall(r"(?m)^```(.*)$", (ROOT / page).read_text())[::2]
    assert all(language for language in opened), opened


def test_every_family_is_told_of() -> None:
    text = (ROOT / "docs/reference/tasks.md").read_text()
    for name in task_names():
        if "/" not in name:
            assert f"\n| {name} | {get_task(name).window:g} s | " in text, name

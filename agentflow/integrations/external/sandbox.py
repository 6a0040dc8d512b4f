"""Isolates programs with bubblewrap: they see their folder and an interpreter, and reach the bench.

They see neither the repository nor this package, whose data and code could be read or changed.
"""

import asyncio
import os
import shutil
import subprocess
import sys
from collections.abc import AsyncIterator, Iterable, Iterator, Sequence
from contextlib import asynccontextmanager
from functools import cache, partial
from pathlib import Path
from urllib.parse import urlsplit

from agentflow.errors import ConfigError
from agentflow.integrations.external import relay
from agentflow.workflows.settings import ExternalSettings

SYSTEM = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/opt")
CONFIGURED = (
    *("ssl", "pki", "ca-certificates", "resolv.conf", "hosts", "nsswitch.conf", "passwd", "group"),
    *("localtime", "ld.so.cache", "alternatives"),
)
"""What programs need of /etc."""
PACKAGE = Path(__file__).resolve().parents[2]
REPOSITORY = PACKAGE.parent if (PACKAGE.parent / "pyproject.toml").exists() else PACKAGE
"""The package, with the repository around it if that is where it is."""


@cache
def sandbox_problem() -> str:
    """Why programs cannot be isolated on this computer; "" if they can."""
    program = shutil.which("bwrap")
    if program is None:
        return "bubblewrap is not installed: install the package bubblewrap of your Linux"
    words = [program, "--unshare-all", "--ro-bind", "/", "/", "true"]
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=20)
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"bubblewrap does not start: {error}"
    why = done.stderr.strip()[-200:]
    return f"bubblewrap does not start: {why}" if done.returncode else ""


def is_isolated(settings: ExternalSettings) -> bool:
    """Whether the program will be isolated; raises ConfigError if it must be and cannot be."""
    if settings.isolate == "never":
        return False
    problem = sandbox_problem()
    if problem and settings.isolate == "always":
        raise ConfigError(f"external.isolate is always, but {problem}")
    return not problem


@asynccontextmanager
async def isolated(
    settings: ExternalSettings, words: Sequence[str], folder: Path, url: str
) -> AsyncIterator[list[str]]:
    """The words that run a program isolated, while the bench at the URL can be reached.

    Args:
        settings: What else the program may read, and whether it may use the network.
        words: The program, by its absolute path, and its arguments.
        folder: The folder that it may write to.
        url: Where the bench is.
    """
    port, file = urlsplit(url).port or 0, folder.parent / "bench"
    server = await asyncio.start_unix_server(partial(_forward, port), file)
    async with server:
        bound = [*_mounts(settings, words), *_bind("--bind", [folder, file])]
        run: Sequence[str] = words
        if not settings.network:
            source = Path(relay.__file__).read_text(encoding="utf-8")
            run = [sys.executable, "-I", "-c", source, str(port), str(file), *words]
        network = ["--share-net"] * settings.network
        yield [
            *(str(shutil.which("bwrap")), "--unshare-all", *network, "--proc", "/proc"),
            *("--dev", "/dev", "--tmpfs", "/tmp", *bound, "--chdir", str(folder), "--", *run),
        ]


async def _forward(port: int, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Connect a caller with the bench."""
    theirs, ours = await asyncio.open_connection("127.0.0.1", port)

    async def pump(source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
        try:
            while data := await source.read(1 << 16):
                sink.write(data)
                await sink.drain()
        except ConnectionError:
            pass
        finally:
            sink.close()

    await asyncio.gather(pump(reader, ours), pump(theirs, writer))


def _mounts(settings: ExternalSettings, words: Sequence[str]) -> list[str]:
    """What a program can read: the system, its own folder, an interpreter, and what is named."""
    home = os.path.expanduser("~")
    own = [Path(sys.prefix), Path(sys.base_prefix), *_program(Path(words[0]), Path(home))]
    named = [Path(word) for word in words[1:] if os.path.isabs(word) and os.path.isfile(word)]
    further = [Path(path).expanduser() for path in settings.readable]
    system = [*map(Path, SYSTEM), *(Path("/etc", name) for name in CONFIGURED)]
    seen = [*system, *own]
    hidden = [REPOSITORY] * any(REPOSITORY.is_relative_to(place) for place in seen)
    return [
        *(["--tmpfs", home] if Path(home) != Path("/") else []),
        *_bind("--ro-bind-try", seen),
        *(word for path in hidden for word in ("--tmpfs", str(path))),
        *_bind("--ro-bind-try", [path for path in own if path.is_relative_to(REPOSITORY)]),
        *_bind("--ro-bind", [*named, *further]),
    ]


def _program(program: Path, home: Path) -> Iterator[Path]:
    """The folder of a program, or of one in `bin` the folder above; itself where that holds more
    than the program."""
    for path in (program, program.resolve()):
        folder = path.parent.parent if path.parent.name == "bin" else path.parent
        broad = home.is_relative_to(folder) or REPOSITORY.is_relative_to(folder)
        inside = path.is_relative_to(REPOSITORY) and path.parent.name != "bin"
        yield path if broad or inside else folder


def _bind(how: str, paths: Iterable[Path]) -> Iterator[str]:
    for path in dict.fromkeys(map(str, paths)):
        yield from (how, path, path)

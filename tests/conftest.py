"""How many processes run tests, how properties are tried, which tests are left out, and a server.

The server is a third party's, on 127.0.0.1.
"""

from __future__ import annotations

import gc
import os
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from hypothesis import HealthCheck, settings

from agentflow.env.physics.registry import ENGINES
from tests.installed import ENVIRONMENTS, missing

settings.register_profile("steady", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("quick", settings.get_profile("steady"), max_examples=20)


def pytest_configure(config: pytest.Config) -> None:
    """No property fails for what else the machine is doing; the fast part draws fewer examples."""
    quick = config.getoption("markexpr") == "not slow"
    settings.load_profile("quick" if quick else "steady")
    for name in ENGINES:
        config.addinivalue_line("markers", f"{name}: needs the physics engine {name}")
    for name, library in ENVIRONMENTS.items():
        config.addinivalue_line("markers", f"{name}: needs {library}, which .venv-{name} holds")


MEMORY = 2 * 2**30
"""Bytes for each process: it takes about 0.8 GB, and starts simulators, servers or a browser."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """With `-n auto`: a process for each processor that may be used, if memory holds as many."""
    usable = getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return max(1, min(len(usable(0)), memory // MEMORY))


LEFT_OUT = pytest.StashKey[Counter[str]]()
"""Marker of something that is not installed -> number of tests with it."""


LONGEST = (
    "tests/env/tasks/test_records.py",
    "tests/test_documented.py",
    "tests/app/sweeps/test_shipped.py",
    "tests/integrations/test_training.py",
    "tests/app/design/test_design.py",
    "tests/test_release.py",
    "tests/integrations/test_inspect_ai.py",
    "tests/env/tasks/test_cheats.py",
    "tests/studio/test_build_page.py",
    "tests/report/test_browser.py",
)
"""Files that take longest, the longest first: they begin, so that no processor waits at the end."""


def rank(item: pytest.Item) -> int:
    name = item.nodeid.partition("::")[0]
    return LONGEST.index(name) if name in LONGEST else len(LONGEST)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Begin with what takes long; leave out and count tests that need what is not installed."""
    items.sort(key=rank)
    names = missing()
    lacking = {item: name for item in items for name in names if item.get_closest_marker(name)}
    items[:] = [item for item in items if item not in lacking]
    for item, name in lacking.items():
        if name in ENVIRONMENTS and not item.nodeid.startswith(f"tests/{name}/"):
            raise pytest.UsageError(
                f"{item.nodeid}: tests with the marker {name} go to tests/{name}"
            )
    config.stash[LEFT_OUT] = Counter(lacking.values())
    if hasattr(config, "workeroutput"):
        config.workeroutput["left_out"] = dict(config.stash[LEFT_OUT])


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Take the numbers over from a worker process; all workers collect the same tests."""
    left_out = getattr(node, "workeroutput", {}).get("left_out", {})
    node.config.stash[LEFT_OUT] = Counter(left_out)


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    left_out = config.stash.get(LEFT_OUT, Counter[str]())
    for name, reason in missing().items():
        if left_out[name]:
            terminalreporter.write_line(f"left out: {left_out[name]} tests, because {reason}")


def pytest_collection_finish() -> None:
    """Modules and 4,000 tests stay to the end: not to look through them again saves 2 %."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Has a library missing until the test ends, for code that imports it when it is called."""

    def hide(library: str) -> None:
        known = [name for name in sys.modules if name.partition(".")[0] == library]
        for name in (library, *known):
            monkeypatch.setitem(sys.modules, name, None)

    return hide


FIXTURES = Path(__file__).parent / "stub_fixtures.yaml"


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def wait_for(url: str, process: subprocess.Popen[bytes], seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        assert process.poll() is None, "the server ended by itself"
        try:
            if httpx.get(url, trust_env=False).status_code == 200:
                return
        except httpx.TransportError:
            time.sleep(0.05)
    raise AssertionError(f"nothing answers at {url}")


@contextmanager
def stub_server(fixtures: Path) -> Iterator[str]:
    """stubllm with a file of fixtures; its base URL."""
    port = free_port()
    command = "from stubllm.cli import cli; cli()"
    arguments = ["serve", "--port", str(port), "--fixture-file", str(fixtures)]
    process = subprocess.Popen(
        [sys.executable, "-c", command, *arguments, "--log-level", "error"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        wait_for(f"http://127.0.0.1:{port}/health", process)
        yield f"http://127.0.0.1:{port}/v1"
    finally:
        process.terminate()
        process.wait(timeout=60)


@pytest.fixture(scope="session")
def stub_url() -> Iterator[str]:
    """Base URL of stubllm with the fixtures beside this file."""
    with stub_server(FIXTURES) as url:
        yield url

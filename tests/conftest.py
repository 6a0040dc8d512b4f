"""How properties are tried, which tests are left out, and a third-party server on 127.0.0.1."""

from __future__ import annotations

import gc
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from hypothesis import HealthCheck, settings

from agentflow.env.physics.engines import ENGINES
from tests.engines import missing_engines

settings.register_profile("steady", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("quick", settings.get_profile("steady"), max_examples=20)


def pytest_configure(config: pytest.Config) -> None:
    """No property fails for what else the machine is doing; the fast part draws fewer examples."""
    quick = config.getoption("markexpr") == "not slow"
    settings.load_profile("quick" if quick else "steady")
    for name in ENGINES:
        config.addinivalue_line("markers", f"{name}: needs the physics engine {name}")


LEFT_OUT = pytest.StashKey[Counter[str]]()
"""Engine that is not installed -> number of tests with its marker."""


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out tests that need an engine that is not installed, and count them."""
    missing = missing_engines()
    lacking = {item: name for item in items for name in missing if item.get_closest_marker(name)}
    items[:] = [item for item in items if item not in lacking]
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
    for name in missing_engines():
        tests = f"{left_out[name]} tests, and any in tests/env/physics/{name}"
        terminalreporter.write_line(f"left out, because {name} is not installed: {tests}")


def pytest_collection_finish() -> None:
    """Modules and 4,000 tests stay to the end: not to look through them again saves 2 %."""
    gc.collect()
    gc.freeze()


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

"""Third-party programs, each from its own environment; servers listen on 127.0.0.1."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.conftest import free_port, wait_for

ROOT = Path(__file__).parents[2]
KEY = "sk-gateway-4f1c77d09a"
"""The gateway's own key."""


def foreign_python(environment: str) -> Path:
    """The interpreter of an environment that `scripts/servers` creates."""
    python = ROOT / environment / "bin" / "python"
    if not python.exists():
        explain = f"{environment} is missing: run scripts/servers"
        if os.environ.get("CI") == "true":
            pytest.fail(explain)
        pytest.skip(explain)
    return python


@contextmanager
def foreign(
    environment: str,
    arguments: list[str],
    health: str,
    folder: Path,
    variables: Mapping[str, str] | None = None,
) -> Iterator[str]:
    """A server of `scripts/servers`; its base URL.

    Args:
        environment: Folder of its virtual environment.
        arguments: What its Python runs; `{port}` is filled in.
        health: Path that answers once it is up.
        folder: Where it runs and leaves its log.
        variables: What it has in its environment besides; it gets nothing of ours.
    """
    python = foreign_python(environment)
    port = free_port()
    log = folder / "server.log"
    with log.open("wb") as output:
        process = subprocess.Popen(
            [str(python), *[argument.format(port=port) for argument in arguments]],
            cwd=folder,
            env={"PATH": os.defpath, "HOME": str(folder), **(variables or {})},
            stdout=output,
            stderr=subprocess.STDOUT,
        )
    try:
        wait_for(f"http://127.0.0.1:{port}{health}", process, seconds=240)
        yield f"http://127.0.0.1:{port}/v1"
    finally:
        process.terminate()
        process.wait(timeout=30)

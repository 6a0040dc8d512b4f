"""Owns how what a run has kept is read back: its machines, and events that may be damaged."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from agentflow.errors import RunError
from agentflow.machine import Machine, library, read_machine


def recorded_machine(path: Path, digest: str) -> Machine:
    """A machine of a run by its content hash.

    Raises:
        RunError: It is not there, or is another one.
    """
    file = path / "machines" / f"{digest}.json"
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise RunError(f"{path} is damaged: it has no readable machines/{digest}.json") from None
    machine = read_machine(text, tuple(library())).machine
    if machine is None or machine.digest != digest:
        raise RunError(f"{file} is damaged: it holds another machine than its name says")
    return machine


@contextmanager
def sound(path: Path) -> Iterator[None]:
    """Say of a run that it is damaged, where its events are lines of JSON but not what they were.

    Raises:
        RunError: An event lacks a key, or has something else there.
    """
    try:
        yield
    except (KeyError, TypeError) as error:
        raise RunError(f"{path} is damaged: an event is not as it was written ({error})") from error

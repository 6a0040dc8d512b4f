"""A book of lessons: what runs have found out, by task, in a file that runs read and extend.

Each line is a JSON object with a task and a lesson. Its texts are data in prompts, never
instructions.
"""

import json
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from agentflow.config.run import DesignConfig
from agentflow.errors import UsageError
from agentflow.files.atomic import os_errors
from agentflow.files.lines import LineFile, parse_object, read_regular

MOST_BYTES = 1_000_000
LONGEST = 300
"""Most characters of a lesson."""
MOST_READ = 100
"""Most lessons of a task that a run takes from a book; prompts have room for fewer."""


def with_lessons(config: DesignConfig, book: Path, task: str) -> DesignConfig:
    """The configuration with what a book knows about a task stored in it, the newest first.

    Raises:
        UsageError: The book cannot be read, is too large, or has a line that is no lesson.
    """
    known = [lesson for about, lesson in read_book(book) if about == task]
    newest = tuple(reversed(known[-MOST_READ:]))
    settings = config.settings.model_copy(update={"known_lessons": newest})
    return config.model_copy(update={"settings": settings})


def read_book(book: Path) -> list[tuple[str, str]]:
    """Task and lesson of each line, the oldest first; none if there is no such file yet."""
    with os_errors(f"cannot read {book}", UsageError):
        content = read_regular(book, MOST_BYTES + 1) if book.exists() else b""
    if len(content) > MOST_BYTES:
        raise UsageError(
            f"{book} is larger than {MOST_BYTES:,} bytes, the most of a lesson book: remove old "
            "lines, or name another file"
        )
    return [_read(book, number, line) for number, line in enumerate(content.splitlines(), 1)]


def _read(book: Path, number: int, line: bytes) -> tuple[str, str]:
    item = parse_object(line) or {}
    task, lesson = item.get("task"), item.get("lesson")
    if not isinstance(task, str) or not isinstance(lesson, str):
        raise UsageError(
            f"line {number} of {book} is not a lesson: it must be a JSON object with task and "
            "lesson, both text; correct or remove it"
        )
    return task, _as_line(lesson)


def _as_line(lesson: str) -> str:
    shown = "".join(letter if letter.isprintable() else " " for letter in lesson)
    return " ".join(shown.split())[:LONGEST]


def extend_book(book: Path, task: str, lessons: Sequence[str]) -> int:
    """Add lessons about a task that the book does not hold, the most telling last, as a book is
    read from its end; their number.

    Raises:
        UsageError: The book cannot be read or written.
    """
    known = set(read_book(book))
    lines = map(_as_line, reversed(lessons))
    new = [lesson for lesson in lines if (task, lesson) not in known]
    with os_errors(f"cannot write {book}", UsageError):
        book.parent.mkdir(parents=True, exist_ok=True)
        with closing(LineFile(book)) as file:
            for lesson in new:
                file.append(json.dumps({"task": task, "lesson": lesson}).encode())
    return len(new)

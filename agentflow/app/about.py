"""The file in which a folder of results says what it holds, so that work in it can be continued."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from agentflow.config.yaml import describe_fault, first_fault
from agentflow.errors import RunError
from agentflow.files import write_atomically

_About = TypeVar("_About", bound=BaseModel)


def write_about(file: Path, about: BaseModel) -> None:
    """Write what a folder holds.

    Raises:
        OSError: It cannot be written.
    """
    with write_atomically(file) as part:
        part.write_text(about.model_dump_json(indent=1) + "\n", encoding="utf-8")


def read_about(file: Path, kind: type[_About], what: str) -> _About:
    """What a folder holds.

    Args:
        file: The file that says so.
        kind: Its content.
        what: What a folder with such a file is, with its article: "an evaluation".

    Raises:
        RunError: It is missing, damaged or cannot be read.
    """
    try:
        return kind.model_validate_json(file.read_bytes())
    except FileNotFoundError:
        raise RunError(f"{file.parent} is not {what}: it has no {file.name}") from None
    except OSError as error:
        raise RunError(f"cannot read {file}: {error.strerror}") from None
    except ValidationError as error:
        fault = first_fault(error)
        place = ".".join(map(str, fault["loc"])) or "the file"
        raise RunError(f"{file} is damaged: {place} {describe_fault(fault)}") from None


def require_empty(file: Path, what: str, leftovers: Collection[str] = ()) -> None:
    """Refuse a folder that holds other files than hidden ones.

    Args:
        file: The file that is missing in it.
        what: As in `read_about`.
        leftovers: Names of files that a start which was killed may have left.

    Raises:
        RunError: It does.
    """
    names = {item.name for item in file.parent.iterdir() if not item.name.startswith(".")}
    if other := sorted(names.difference(leftovers)):
        raise RunError(
            f"{file.parent} is not {what}: it has {other[0]} and no {file.name}; choose a new "
            "folder with --out"
        )


def require_same(
    folder: Path, what: str, before: Mapping[str, Any], now: Mapping[str, Any]
) -> None:
    """Refuse to continue something else than what was begun.

    Args:
        folder: Where it was begun.
        what: As in `read_about`.
        before: Everything that decided its results.
        now: The same for what is to be continued, with the same keys.

    Raises:
        RunError: A value differs.
    """
    other = next((key for key in now if before[key] != now[key]), None)
    if other is not None:
        raise RunError(
            f"{folder} holds {what} with another {other}: {before[other]}, not {now[other]}; give "
            "the same options to continue it, or choose another folder with --out"
        )

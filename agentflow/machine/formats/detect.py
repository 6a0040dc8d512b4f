"""Read the text of files and of standard input as a machine in any of its three forms:
construction tree, coordinates, .bsg file."""

import io
import re
import sys
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path
from typing import AnyStr, Literal, TextIO

from agentflow.errors import UsageError
from agentflow.machine.brief import Brief
from agentflow.machine.formats.coordinates import read_coordinates
from agentflow.machine.formats.parse import FORM, Reading, find_document, read_machine
from agentflow.machine.tree import Machine

UTF_16_MARKS = (b"\xff\xfe", b"\xfe\xff")
LARGEST = 64 * 2**20
"""Most bytes of a text (characters for standard input); refuses endless files."""


def read_text(source: str) -> str:
    """The text of a file, or of standard input for `-`; UTF-8, or UTF-16 with a byte order mark."""
    if source == "-":
        return _limit_size(_standard_input().read(LARGEST + 1), "standard input")
    try:
        with Path(source).open("rb") as file:
            data = _limit_size(file.read(LARGEST + 1), source)
        return data.decode("utf-16" if data.startswith(UTF_16_MARKS) else "utf-8-sig")
    except OSError as error:
        raise UsageError(f"cannot read {source}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise UsageError(f"{source} is not a text file") from None


def _limit_size(data: AnyStr, source: str) -> AnyStr:
    if len(data) > LARGEST:
        raise UsageError(f"{source} is larger than {LARGEST // 2**20} MB; expected a machine")
    return data


def read_lines(source: str) -> Iterator[str]:
    """The lines of a file, or of standard input for `-`, including blank ones."""
    if source == "-":
        yield from _standard_input()
        return
    try:
        with Path(source).open(encoding="utf-8-sig", errors="replace") as lines:
            yield from lines
    except OSError as error:
        raise UsageError(f"cannot read {source}: {error.strerror}") from None


def _standard_input() -> TextIO:
    """Standard input as UTF-8; invalid bytes are replaced."""
    if sys.stdin is None:
        raise UsageError("standard input is closed; name a file")
    if isinstance(sys.stdin, io.TextIOWrapper):
        sys.stdin.reconfigure(encoding="utf-8-sig", errors="replace")
    return sys.stdin


Form = Literal["auto", "tree", "coordinates", "bsg"]

_XML = re.compile(r"\s*(<!--((?!-->).)*-->\s*)*<(\?xml|!DOCTYPE|Machine)\b", re.DOTALL)
"""Beginning of a .bsg file. Comments end at their first `-->`, which avoids exponential
backtracking."""


def read_any(
    source: object,
    form: Form = "auto",
    blocks: Collection[int] | None = None,
    given: Machine | None = None,
) -> Reading:
    """Read a machine in any form. Never raises; `validity.check` checks the result.

    Args:
        source: any text, or JSON data.
        form: `auto` reads text that starts like XML as a .bsg file, and a list whose objects have
            `Position` but not `parent` as coordinates.
        blocks: allowed block types; the core types if None.
        given: blocks that a tree must begin with; any root if None.
    """
    if form == "bsg" or (form == "auto" and isinstance(source, str) and _XML.match(source)):
        from agentflow.machine.formats.bsg_reading import read_bsg  # slow to import, rarely needed

        return read_bsg(source if isinstance(source, str) else "", blocks)
    if form == "tree":
        return read_machine(source, blocks, given)
    if form == "coordinates":
        return read_coordinates(source, blocks)
    document = find_document(source, FORM)
    if document.fault is not None:
        return Reading(None, document.repaired, problems=(document.fault,))
    data = document.but(document.blocks)
    if _has_positions(document.blocks):
        reading = read_coordinates(data, blocks)
    else:
        reading = read_machine(data, blocks, given)
    notes = (*document.notes, *reading.notes)
    return replace(reading, repaired=document.repaired, notes=notes)


def read_for(brief: Brief | None, source: object, form: Form = "auto") -> Reading:
    """Read a machine under a task's rules, or with core types only; see `read_any`."""
    if brief is None:
        return read_any(source, form)
    return read_any(source, form, brief.blocks, brief.given)


def _has_positions(items: list[object]) -> bool:
    found = [item for item in items if isinstance(item, dict)]
    return any("Position" in item for item in found) and not any("parent" in item for item in found)

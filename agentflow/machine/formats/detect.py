"""Read a machine in any of its three forms: construction tree, coordinates, .bsg file."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import replace
from typing import Literal

from agentflow.machine.brief import Brief
from agentflow.machine.formats.coordinates import read_coordinates
from agentflow.machine.formats.parse import FORM, Reading, find_document, read_machine
from agentflow.machine.tree import Machine

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

"""The parts list of a machine: how many of which blocks, and what they weigh."""

from __future__ import annotations

import csv
import io
from collections import Counter
from typing import Any

from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine
from agentflow.making.parts import parts_of

COLUMNS = ("type", "name", "size", "number", "mass", "total_mass")


def bill(machine: Machine) -> list[dict[str, Any]]:
    """A row for each block type, by type; two-ended blocks have one for each length.

    Each has `type`, `name`, `size` (m: extents along the block's own x, y, z, or its length),
    `number`, `mass` (of one, kg) and `total_mass` (kg).
    """
    counts = Counter((part.kind.type, part.rod_length or 0.0) for part in parts_of(machine))
    rows = []
    for (number, long), count in sorted(counts.items()):
        kind = library()[number]
        size = " x ".join(f"{side:g}" for side in kind.size or (round(long, 3),))
        row = {"type": number, "name": kind.name, "size": size, "number": count}
        rows.append({**row, "mass": kind.mass, "total_mass": round(count * kind.mass, 6)})
    return rows


def bill_csv(machine: Machine) -> str:
    """The parts list as a table, with a line of headings."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(bill(machine))
    return text.getvalue()

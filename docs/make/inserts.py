"""Generated tables and lists within pages that people write, between marks in HTML comments.

<!-- generated: levels -->
...
<!-- end of levels -->
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial

from agentflow.app.machines.files import list_blocks
from agentflow.app.tasks import list_tasks
from docs.make.markdown import blocks, code, table
from docs.make.pages import SECTIONS, pages_of

_MARKED = re.compile(r"(?ms)^<!-- generated: (?P<name>.+?) -->$.*?^<!-- end of (?P=name) -->$")


def fill(text: str) -> str:
    """A page with its inserts as the code has them now; KeyError if one is unknown."""
    return _MARKED.sub(lambda found: _insert(found["name"]), text)


def marked(text: str) -> list[str]:
    """Names of the inserts of a page."""
    return [found["name"] for found in _MARKED.finditer(text)]


def _insert(name: str) -> str:
    return f"<!-- generated: {name} -->\n\n{INSERTS[name]()}\n\n<!-- end of {name} -->"


def _blocks() -> str:
    rows = []
    for block in list_blocks():
        kind, name = block["type"], block["name"]
        size = "two-ended" if block["two_ended"] else " x ".join(f"{n:g}" for n in block["size"])
        group = "extended" if block["extended"] else "core"
        picture = f"![{name}](../pictures/blocks/{kind}.png)"
        faces = str(len(block["faces"]))
        rows.append((str(kind), name, size, f"{block['mass']:g}", faces, group, picture))
    return table(("type", "block", "size, m", "mass, kg", "faces", "set", "picture"), rows)


def _levels() -> str:
    rows, engines = [], set()
    for level in list_tasks():
        record = level["record"]
        best = "" if level["greatest"] is None else f"{level['greatest']:g}"
        fragile = " (fragile)" * record["fragile"]
        found = (f"{record['verified']:.4g}{fragile}", str(record["blocks"]))
        numbers = (f"{level['window']:g}", f"{level['good']:g}", best)
        rows.append((code(level["name"]), level["title"], *numbers, *found))
        engines.add(record["engine"])
    head = ("level", "title", "window, s", "good", "greatest", "record", "blocks")
    return blocks(table(head, rows), f"Engine of the records: {', '.join(sorted(engines))}.")


def _pages(folder: str) -> str:
    """A list of links, as docs/index.md has it."""
    return "\n".join(f"* [{page.title}]({page.path.as_posix()})" for page in pages_of(folder))


INSERTS: Mapping[str, Callable[[], str]] = {
    "blocks": _blocks,
    "levels": _levels,
    **{folder: partial(_pages, folder) for folder in SECTIONS},
}

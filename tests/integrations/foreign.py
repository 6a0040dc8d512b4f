"""Programs in the environments of other libraries, which `scripts/servers` creates."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Mapping
from pathlib import Path

from tests.llm.foreign import ROOT, foreign_python

PLUGINS = Path(__file__).parent / "plugins"
"""A distribution as pip would leave it: the family `faulty`."""
CAR = (ROOT / "examples" / "car.json").read_text(encoding="utf-8")
LONGEST = 15
"""Most lines of an example, without empty ones."""


def run_foreign(
    environment: str,
    folder: Path,
    *arguments: object,
    variables: Mapping[str, str] | None = None,
) -> str:
    """Standard output of the Python of an environment, which must succeed.

    Args:
        environment: Folder of the environment.
        folder: Where it runs, and its home.
        arguments: What its Python runs.
        variables: What it has in its environment besides; it gets nothing of ours.
    """
    done = subprocess.run(
        [str(foreign_python(environment)), *map(str, arguments)],
        cwd=folder,
        env={"PATH": os.defpath, "HOME": str(folder), **(variables or {})},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def documented_code(page: str, part: int | None = None) -> str:
    """The Python code on a page of docs/integrations, or in one of its blocks; each is short."""
    text = (ROOT / "docs" / "integrations" / f"{page}.md").read_text(encoding="utf-8")
    blocks = re.findall(r"(?ms)^```python\n(.*?)^```$", text)
    assert all(len([*filter(None, block.splitlines())]) <= LONGEST for block in blocks)
    return "".join(blocks if part is None else [blocks[part]])


def offer_examples(folder: Path) -> None:
    """Put the machine of the examples where documented code looks for it."""
    (folder / "examples").mkdir()
    (folder / "examples" / "car.json").write_text(CAR, encoding="utf-8")

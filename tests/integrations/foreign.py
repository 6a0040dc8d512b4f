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


def documented_code(heading: str) -> str:
    """The Python code in a section of docs/how-to/libraries.md."""
    page = (ROOT / "docs" / "how-to" / "libraries.md").read_text(encoding="utf-8")
    section = page.split(f"\n## {heading}\n", 1)[1].partition("\n## ")[0]
    code = "".join(re.findall(r"(?ms)^```python\n(.*?)^```$", section))
    assert "assert" in code
    return code

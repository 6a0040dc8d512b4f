"""Builds the static site with Zensical: `python -m docs.make.site`."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from agentflow.env.tasks.registry import FAMILIES, task_names
from agentflow.progress import Progress
from docs.make.gallery import write_gallery
from docs.make.links import ROOT
from docs.make.stage import GALLERY, stage

ZENSICAL = ROOT / ".venv-docs" / "bin" / "zensical"
SITE = ROOT / "site"
ONLINE = ("404.html", "sitemap.xml", "search.json")
"""Files for sites on a server."""


def build(out: Path, levels: Sequence[str], *, workers: int, say: Progress) -> None:
    """Write the site to a folder, in place of what is there.

    Args:
        out: The folder.
        levels: Levels whose machines the gallery shows.
        workers: Processes for simulations.
        say: Receives the progress of simulations.
    """
    with TemporaryDirectory() as name:
        folder = Path(name)
        stage(folder)
        write_gallery(folder / "docs" / GALLERY, levels, workers=workers, say=say)
        subprocess.run([ZENSICAL, "build", "--strict"], cwd=folder, check=True)
        for file in ONLINE:
            (folder / "site" / file).unlink()
        shutil.rmtree(out, ignore_errors=True)
        shutil.move(folder / "site", out)


def main() -> None:
    """Build the site with every level that ships with the package."""
    levels = [name for name in task_names() if name.partition("/")[0] in FAMILIES.ours]
    build(SITE, levels, workers=os.cpu_count() or 1, say=_print_progress)
    print(f"open {SITE / 'index.html'}")


def _print_progress(done: int, of: int) -> None:
    print(f"\rgallery: {done} of {of} machines", end="\n" if done == of else "", file=sys.stderr)


if __name__ == "__main__":
    main()

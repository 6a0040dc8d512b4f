"""The folder of runs: names of runs as the page gives them, and the paths that they stand for."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from agentflow.app.benchmark.card import NAME as CARD
from agentflow.app.benchmark.card import Scorecard
from agentflow.app.benchmark.leaderboard import cards_in, comparable, read_cards
from agentflow.app.sweeps.folder import is_sweep
from agentflow.errors import RunError, UsageError
from agentflow.files.folders import require_plain_files
from agentflow.runs.reading import FILE_NAME

LONGEST = 400
"""Characters of a name."""
SHIPPED = Path(__file__).parents[2] / "docs" / "cards"
"""The folder of the repository with scorecards to compare with; missing without the repository."""


class RunFolder:
    """The runs below one folder, by name: their path in it, with slashes."""

    def __init__(self, root: Path) -> None:
        """`root` may be missing; the first run creates it."""
        self.root = root

    def name_of(self, path: Path) -> str:
        """The name of a run in this folder."""
        return path.relative_to(self.root).as_posix()

    def run(self, name: str) -> Path:
        """The directory of a run.

        Raises:
            UsageError: The name leads out of the folder, or through a link.
            RunError: It does not exist, or it holds links.
        """
        path = self._path(name)
        if not (path / FILE_NAME).is_file():
            raise RunError(f"{self.root} does not hold a run named {name[:80]!r}")
        require_plain_files(path)
        return path

    def sweep(self, name: str) -> Path:
        """The directory of a sweep; `name` may be that of this folder itself.

        Raises:
            UsageError: The name leads out of the folder, or through a link.
            RunError: It is not a sweep, or it holds links.
        """
        path = self.root if name == self.root.name and is_sweep(self.root) else self._path(name)
        if not is_sweep(path):
            raise RunError(f"{self.root} does not hold a sweep named {name[:80]!r}")
        require_plain_files(path)
        return path

    def cards(self) -> list[list[Scorecard]]:
        """The scorecards below the folder and those that the repository ships, best first, those
        that can be compared together; a copy of a card counts once."""
        own = [path for path in sorted(self.root.rglob(CARD)) if not path.is_symlink()]
        return [read_cards(paths) for paths in comparable((*own, *cards_in(SHIPPED)))]

    def _path(self, name: str) -> Path:
        parts = PurePosixPath(name).parts
        plain = name == "/".join(parts) and 0 < len(name) <= LONGEST and name.isprintable()
        if not plain or any(part[0] in "./~" or set(part) & set(":\\") for part in parts):
            raise UsageError(f"{name[:80]!r} is not the name of a run: name one from the list")
        path = self.root
        for part in parts:
            path = path / part
            if path.is_symlink():
                raise UsageError(f"{name[:80]!r} leads through a link; runs are plain folders")
        return path

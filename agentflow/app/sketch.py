"""The user's sketch of a machine: a picture for models, which a run keeps by its hash."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image

from agentflow.errors import DamagedError, RunError, UsageError
from agentflow.files.atomic import write_file
from agentflow.files.lines import read_regular

SKETCH = "sketch"
"""Key of run.yaml: the hash of the sketch."""
MOST_BYTES, MOST_PIXELS = 20_000_000, 50_000_000
"""Of the file that is read."""
SIDE = 1024
"""Most pixels of the longer side of what models see: more costs tokens and shows no more."""


@dataclass(frozen=True)
class Sketch:
    """A sketch as models see it: PNG, at most `SIDE` pixels long, on white paper."""

    png: bytes

    @classmethod
    def read(cls, file: Path) -> Sketch:
        """Read a PNG file; raises UsageError unless it is one, and not too large."""
        too_large = f"the sketch {file} has more than {{}} million {{}}: make it smaller"
        try:
            data = read_regular(file, MOST_BYTES + 1)
        except OSError as error:
            raise UsageError(f"cannot read the sketch {file}: {error.strerror}") from None
        if len(data) > MOST_BYTES:
            raise UsageError(too_large.format(MOST_BYTES // 10**6, "bytes"))
        try:
            with Image.open(BytesIO(data), formats=("PNG",)) as picture:
                if picture.width * picture.height > MOST_PIXELS:
                    raise UsageError(too_large.format(MOST_PIXELS // 10**6, "pixels"))
                shown = picture.convert("RGBA")
        except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
            raise UsageError(f"the sketch {file} is no whole PNG picture: save it as PNG") from None
        shown.thumbnail((SIDE, SIDE))
        paper, content = Image.new("RGBA", shown.size, "white"), BytesIO()
        paper.alpha_composite(shown)
        paper.convert("RGB").save(content, "PNG", optimize=True)
        return cls(content.getvalue())

    @classmethod
    def of_run(cls, path: Path, document: Mapping[str, Any]) -> Sketch:
        """That of a run, whose run.yaml holds `document`; raises DamagedError if it has changed."""
        file = path / f"sketch-{document.get(SKETCH)}.png"
        found = cls(file.read_bytes()) if file.is_file() else None
        if found is None or found.digest != document.get(SKETCH):
            raise DamagedError(f"{file}, the sketch of the run, is missing or has changed")
        return found

    def write(self, path: Path) -> None:
        """Keep it in the run at `path`."""
        write_file(path / f"sketch-{self.digest}.png", self.png, RunError)

    @property
    def digest(self) -> str:
        """SHA-256 of the picture, 16 hex digits."""
        return hashlib.sha256(self.png).hexdigest()[:16]

    @property
    def url(self) -> str:
        """The picture as a data URL."""
        return "data:image/png;base64," + base64.b64encode(self.png).decode()

"""Digests of files that decide a result, so that continued work notices when they have changed."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

from agentflow.models.local.folder import find_model
from agentflow.training.config import TrainingConfig
from agentflow.training.data.pairs import DEV, TRAIN

PART = 1 << 20
"""Bytes that are read at a time."""
MOST_PARTS = 64
"""Parts of a model's file that count. Files of up to 64 MiB count as a whole, larger ones by parts
spread over them: 28 GB take less than a second, and training changes all weights."""


def digest_set(folder: Path) -> str:
    """Digest of the pairs of a set, whole."""
    return _digest_files(file for file in (folder / TRAIN, folder / DEV) if file.is_file())


def digest_model(folder: Path) -> str:
    """Digest of the files of a model: configuration, tokenizer, weights.

    For an adapter, those of the model that it belongs to do not count.

    Raises:
        ConfigError: The folder holds no model.
    """
    files = (path for path in find_model(folder).iterdir() if not path.name.startswith("."))
    return _digest_files((path for path in files if path.is_file()), MOST_PARTS)


def digest_base(config: TrainingConfig) -> dict[str, str]:
    """Key of the model to begin with -> its digest; nothing if it is not in a folder."""
    folder = Path(config.model.name or "")
    return {"model.name": digest_model(folder)} if config.model.name and folder.is_dir() else {}


def _digest_files(files: Iterable[Path], most: int | None = None) -> str:
    """Digest of names, sizes and content, of which at most so many parts of each file count."""
    digest = hashlib.sha256()
    for file in sorted(files):
        size = file.stat().st_size
        digest.update(f"{file.name} {size}\n".encode())
        with file.open("rb") as content:
            for start in range(0, size, max(PART, size // most if most else 0)):
                content.seek(start)
                digest.update(content.read(PART))
    return digest.hexdigest()[:16]

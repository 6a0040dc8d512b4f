"""run.yaml: its schema, and the seal that reveals later edits."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from shlex import quote
from typing import Any

import yaml

from agentflow.errors import RunError
from agentflow.files import require_plain_files

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""Both read the same data; libyaml, if installed, is seven times as fast."""

SCHEMA = 1
"""Version of the layout of run directories; other versions are refused."""
FILE_NAME = "run.yaml"
_SEAL = "seal"


def document_text(document: Mapping[str, Any]) -> str:
    """The text of run.yaml for JSON-like data: schema first, the seal last."""
    content = {"schema": SCHEMA, **document}
    return yaml.safe_dump({**content, _SEAL: seal_of(content)}, sort_keys=False)


def seal_of(content: Mapping[str, Any]) -> str:
    """Hash of the content of run.yaml without `seal`, 16 hex digits."""
    sealed = {key: value for key, value in content.items() if key != _SEAL}
    text = json.dumps(sealed, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def read_document(path: Path) -> dict[str, Any]:
    """The content of a run's run.yaml, without its seal.

    Raises:
        RunError: It is missing, damaged or edited, or has another schema; or the run holds links.
    """
    file = path / FILE_NAME
    if path.is_dir():
        require_plain_files(path)
    try:
        document = yaml.load(file.read_text(encoding="utf-8"), _LOADER)
    except OSError:
        raise RunError(f"{path} is not a run directory: it has no readable {FILE_NAME}") from None
    except (yaml.YAMLError, ValueError, RecursionError):
        document = None
    if not isinstance(document, dict) or "schema" not in document:
        raise RunError(f"{file} is damaged: expected a mapping with `schema`")
    if not isinstance(document.get("config", {}), dict):
        raise RunError(f"{file} is damaged: its config is not a mapping")
    if document["schema"] != SCHEMA:
        raise RunError(
            f"{path} has schema {document['schema']!r}, but this version reads only "
            f"schema {SCHEMA}: use the agentflow version that wrote it"
        )
    if document.pop(_SEAL, None) != seal_of(document):
        raise RunError(
            f"{file} was edited after the run began and no longer matches the record; restore "
            f"it, or start a new run with: agentflow design --config {quote(str(file))}"
        )
    return document

"""Owns run.yaml: its schema, and the seal by which a later change of it is noticed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from shlex import quote
from typing import Any

import yaml

from agentflow.errors import RunError

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The same data from either; libyaml, where there is one, takes a seventh of the time."""

SCHEMA = 1
"""Version of the layout of run directories; written to run.yaml, refused when foreign."""
NAME = "run.yaml"
_SEAL = "seal"


def document_text(document: Mapping[str, Any]) -> str:
    """The text of run.yaml for JSON-like data: schema first, the seal over everything last."""
    content = {"schema": SCHEMA, **document}
    return yaml.safe_dump({**content, _SEAL: seal_of(content)}, sort_keys=False)


def seal_of(content: Mapping[str, Any]) -> str:
    """Hash of the content of run.yaml, 16 hex digits; `seal` itself does not count."""
    sealed = {key: value for key, value in content.items() if key != _SEAL}
    text = json.dumps(sealed, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def read_document(path: Path) -> dict[str, Any]:
    """The content of a run's run.yaml, without its seal.

    Raises:
        RunError: There is none, it is damaged or edited, or its schema is not this version's.
    """
    file = path / NAME
    try:
        document = yaml.load(file.read_text(encoding="utf-8"), _LOADER)
    except OSError:
        raise RunError(f"{path} is no run: it has no readable {NAME}") from None
    except (yaml.YAMLError, ValueError, RecursionError):
        document = None
    if not isinstance(document, dict) or "schema" not in document:
        raise RunError(f"{file} is damaged: expected a mapping with `schema`")
    if document["schema"] != SCHEMA:
        raise RunError(
            f"{path} has schema {document['schema']!r}, this version reads {SCHEMA}: "
            "use the agentflow version that wrote it"
        )
    if document.pop(_SEAL, None) != seal_of(document):
        raise RunError(
            f"{file} was changed after the run began, so the record no longer belongs to it; put "
            f"it back, or begin another run with: agentflow design --config {quote(str(file))}"
        )
    return document

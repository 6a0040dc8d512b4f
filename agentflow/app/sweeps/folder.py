"""The folder of a sweep.

SWEEP/sweep.yaml      the resolved sweep; written first
SWEEP/members.jsonl   one line per finished or failed run, with the reason
SWEEP/runs/<name>/    ordinary run directories
SWEEP/store/          machines and rollouts by content
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime, timezone
from pathlib import Path
from shlex import quote
from typing import Any

import yaml

from agentflow import __version__
from agentflow.app.design.config import config_json
from agentflow.app.design.plan import describe_changes, physics_conditions
from agentflow.config.run import PROCEDURAL, build_config
from agentflow.config.sweep import SweepConfig, read_sweep
from agentflow.config.yaml import NOT_YAML
from agentflow.errors import RunError
from agentflow.files import (
    cannot_write,
    hold_folder,
    require_plain_files,
    whole_lines,
    write_atomically,
)

SCHEMA = 1
NAME, LOG, RUNS, STORE = "sweep.yaml", "members.jsonl", "runs", "store"


def sweep_document(name: str, sweep: SweepConfig) -> dict[str, Any]:
    """Content of sweep.yaml: everything that decides the runs, without credentials."""
    plain = sweep.model_dump(mode="json", exclude=None if sweep.benchmark else {"benchmark"})
    return {"name": name, "sweep": {**plain, "base": config_json(build_config(sweep.base))}}


def is_sweep(path: Path) -> bool:
    """Whether a folder holds a sweep."""
    return (path / NAME).is_file()


def read_folder(path: Path) -> tuple[dict[str, Any], SweepConfig]:
    """The content of sweep.yaml, and the sweep in it.

    Raises:
        RunError: The file is missing or damaged, or has another schema; or the sweep holds links.
    """
    if path.is_dir():
        require_plain_files(path)
    try:
        document = yaml.safe_load((path / NAME).read_text(encoding="utf-8"))
    except OSError:
        raise RunError(f"{path} is not a sweep directory: it has no readable {NAME}") from None
    except NOT_YAML:
        document = None
    if not isinstance(document, dict) or not {"schema", "name", "sweep"} <= document.keys():
        raise RunError(f"{path / NAME} is damaged: expected a mapping with schema, name and sweep")
    if document["schema"] != SCHEMA:
        raise RunError(
            f"{path} has schema {document['schema']!r}, but this version reads only "
            f"schema {SCHEMA}: use the agentflow version that wrote it"
        )
    return document, read_sweep(document["sweep"], str(path / NAME))


@contextmanager
def lock_folder(path: Path, document: Mapping[str, Any], resume: bool) -> Iterator[None]:
    """Create or reopen the folder of a sweep, and lock it for this process.

    Args:
        path: The folder.
        document: From `sweep_document`.
        resume: Whether the folder may already hold the sweep.

    Raises:
        RunError: The folder holds a sweep that must not be resumed, is in use by another process,
            or cannot be written.
    """
    with hold_folder(path):
        if is_sweep(path):
            _require_same_sweep(path, document, resume)
        else:
            _write_new(path / NAME, document)
        yield


def _require_same_sweep(path: Path, document: Mapping[str, Any], resume: bool) -> None:
    if not resume:
        raise RunError(
            f"{path} already holds this sweep: resume it with --resume, or choose another "
            "folder with --out"
        )
    recorded, _ = read_folder(path)
    if changed := describe_changes(recorded, _conditions(document)):
        raise RunError(
            f"{path} was started with different {changed}: further runs would not be comparable; "
            "choose another folder with --out"
        )
    whole = {"engine": document["sweep"]["base"]["engine"]}  # older sweeps do not name it
    begun = {**recorded["sweep"], "base": {**whole, **recorded["sweep"]["base"]}}
    if different := first_difference(begun, document["sweep"]):
        command = "benchmark" if "benchmark" in document["sweep"] else "sweep"
        raise RunError(
            f"{path} was started with a different {different}: resume it unchanged with "
            f"agentflow {command} {quote(str(path))} --resume, or choose another folder with --out"
        )


def _conditions(document: Mapping[str, Any]) -> dict[str, str]:
    """The physics of a sweep's runs, unless an axis sets their engine."""
    return physics_conditions(document["sweep"]["base"]["engine"])


def first_difference(one: Any, other: Any, place: str = "") -> str:
    """The first dotted key whose values differ; "" if there is none."""
    if one == other:
        return ""
    if not (isinstance(one, dict) and isinstance(other, dict)):
        return place
    key = next(k for k in {**one, **other} if one.get(k) != other.get(k))
    return first_difference(one.get(key), other.get(key), f"{place}.{key}" if place else key)


def _write_new(file: Path, document: Mapping[str, Any]) -> None:
    head = {
        "schema": SCHEMA,
        "agentflow": __version__,
        **_conditions(document),
        "begun": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }
    text = yaml.safe_dump({**head, **document}, sort_keys=False)
    try:
        with write_atomically(file) as part:
            part.write_text(text, encoding="utf-8")
    except OSError as error:
        raise cannot_write(file.parent, error) from None


def folder_name(name: str, sweep: SweepConfig) -> str:
    """Folder name of a sweep: its name and, unless procedural, its model."""
    model = build_config(sweep.base).model.name
    kept = "".join(c if c.isalnum() or c in "._-" else "-" for c in model)
    return name if model == PROCEDURAL else f"{name}-{kept}"


def read_failures(path: Path) -> dict[str, str]:
    """Name of each run whose last attempt failed -> reason in one line."""
    found: dict[str, str] = {}
    log = path / LOG
    for number, line in whole_lines(log) if log.exists() else ():
        try:
            item = json.loads(line)
            found.pop(item["run"], None)
            if item["state"] == "failed":
                found[item["run"]] = item["reason"]
        except (ValueError, KeyError, TypeError):
            raise RunError(f"{log} is damaged in line {number}") from None
    return found

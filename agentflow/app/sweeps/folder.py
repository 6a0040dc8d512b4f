"""The folder of a sweep.

SWEEP/sweep.yaml      the resolved sweep; written first
SWEEP/members.jsonl   one line per finished or failed run, with the reason
SWEEP/runs/<name>/    ordinary run directories
SWEEP/store/          machines and rollouts by content
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime, timezone
from pathlib import Path
from shlex import quote
from typing import Any

import yaml
from pydantic import BaseModel

from agentflow.app.design.conditions import describe_changes
from agentflow.app.design.config import config_json
from agentflow.config.run import PROCEDURAL, build_config
from agentflow.config.sweep import SweepConfig, read_sweep
from agentflow.env.physics.engines import physics_conditions
from agentflow.errors import RunError
from agentflow.files.documents import first_difference, read_yaml_document, write_part
from agentflow.files.folders import hold_folder
from agentflow.files.lines import read_lines
from agentflow.version import __version__

SCHEMA = 1
NAME, LOG, RUNS, STORE = "sweep.yaml", "members.jsonl", "runs", "store"


class _Member(BaseModel):
    """What readers rely on in a line of members.jsonl; lines may hold more."""

    run: str
    state: str
    reason: str = ""


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
    document = read_yaml_document(
        path / NAME, "a sweep directory", SCHEMA, "schema, name and sweep", ("name", "sweep")
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
            f"{path} was started with a different {different.key}: resume it unchanged with "
            f"agentflow {command} {quote(str(path))} --resume, or choose another folder with --out"
        )


def _conditions(document: Mapping[str, Any]) -> dict[str, str]:
    """The physics of a sweep's runs, unless an axis sets their engine."""
    return physics_conditions(document["sweep"]["base"]["engine"])


def _write_new(file: Path, document: Mapping[str, Any]) -> None:
    head = {
        "schema": SCHEMA,
        "agentflow": __version__,
        **_conditions(document),
        "begun": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }
    write_part(file, yaml.safe_dump({**head, **document}, sort_keys=False))


def folder_name(name: str, sweep: SweepConfig) -> str:
    """Folder name of a sweep: its name and, unless procedural, its model."""
    model = build_config(sweep.base).model.name
    kept = "".join(c if c.isalnum() or c in "._-" else "-" for c in model)
    return name if model == PROCEDURAL else f"{name}-{kept}"


def read_failures(path: Path) -> dict[str, str]:
    """Name of each run whose last attempt failed -> reason in one line."""
    found: dict[str, str] = {}
    for member in read_lines(path / LOG, _Member.model_validate_json):
        found.pop(member.run, None)
        if member.state == "failed":
            found[member.run] = member.reason
    return found

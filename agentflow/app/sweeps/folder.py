"""Owns a sweep on disk: sweep.yaml, the log of its runs, where each run and the store lie.

SWEEP/sweep.yaml      the resolved sweep; written first
SWEEP/members.jsonl   one line whenever a run has ended: done or failed, and why
SWEEP/runs/<name>/    ordinary run directories
SWEEP/store/          machines and rollouts by content
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime, timezone
from pathlib import Path
from shlex import quote
from typing import Any

import yaml

from agentflow import __version__
from agentflow.app.design.config import config_json
from agentflow.app.design.plan import engine_change
from agentflow.config.run import PROCEDURAL, build
from agentflow.config.sweep import SweepConfig, read_sweep
from agentflow.config.yaml import NOT_YAML
from agentflow.env.constants import constants
from agentflow.env.physics.engines import default_engine
from agentflow.errors import RunError
from agentflow.files import write_atomically

SCHEMA = 1
NAME, LOG, RUNS, STORE = "sweep.yaml", "members.jsonl", "runs", "store"


def document_of(name: str, sweep: SweepConfig) -> dict[str, Any]:
    """What is written of a sweep: everything that decides its runs, without credentials."""
    plain = sweep.model_dump(mode="json")
    return {"name": name, "sweep": {**plain, "base": config_json(build(sweep.base))}}


def is_sweep(path: Path) -> bool:
    """Whether a folder is a sweep's."""
    return (path / NAME).is_file()


def read_folder(path: Path) -> tuple[dict[str, Any], SweepConfig]:
    """The content of sweep.yaml, and the sweep in it.

    Raises:
        RunError: There is none, it is damaged, or its schema is not this version's.
        ConfigError: The sweep in it is wrong.
    """
    try:
        document = yaml.safe_load((path / NAME).read_text(encoding="utf-8"))
    except OSError:
        raise RunError(f"{path} is no sweep: it has no readable {NAME}") from None
    except NOT_YAML:
        document = None
    if not isinstance(document, dict) or not {"schema", "name", "sweep"} <= document.keys():
        raise RunError(f"{path / NAME} is damaged: expected a mapping with schema, name and sweep")
    if document["schema"] != SCHEMA:
        raise RunError(
            f"{path} has schema {document['schema']!r}, this version reads {SCHEMA}: "
            "use the agentflow version that wrote it"
        )
    return document, read_sweep(document["sweep"], str(path / NAME))


@contextmanager
def held(path: Path, document: Mapping[str, Any], resume: bool) -> Iterator[None]:
    """Make a sweep's folder, or take it up again, for this process alone.

    Args:
        path: The folder.
        document: From `document_of`.
        resume: Whether the sweep may have been begun before.

    Raises:
        RunError: It was begun before and is not to be resumed, or was begun otherwise; another
            process is at it; it cannot be written.
    """
    with _locked(path):
        if is_sweep(path):
            _same(path, document, resume)
        else:
            _write_new(path / NAME, document)
        yield


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """The folder, made where it is missing, for this process alone."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        folder = os.open(path, os.O_RDONLY)
    except OSError as error:
        raise _unwritable(path, error) from None
    try:
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise RunError(f"{path} is in use by another process; wait for it or stop it") from None
        yield
    finally:
        os.close(folder)


def _same(path: Path, document: Mapping[str, Any], resume: bool) -> None:
    if not resume:
        raise RunError(
            f"{path} holds this sweep already: continue it with --resume, or choose another "
            "folder with --out"
        )
    begun, _ = read_folder(path)
    engine = str(default_engine().identity)
    changed = "" if begun.get("constants") == constants().digest else "physical constants"
    if begun.get("engine", engine) != engine:
        changed = f"engine ({engine_change(begun['engine'], engine)})"
    if changed:
        raise RunError(
            f"{path} was started with different {changed}: further runs would not be comparable; "
            "choose another folder with --out"
        )
    different = _difference(begun["sweep"], document["sweep"], "")
    if different:
        raise RunError(
            f"{path} was begun with another {different}: continue it as it was begun with "
            f"agentflow sweep {quote(str(path))} --resume, or choose another folder with --out"
        )


def _difference(one: Any, other: Any, place: str) -> str:
    """The first key with different values; "" without one."""
    if one == other:
        return ""
    if not (isinstance(one, dict) and isinstance(other, dict)):
        return place
    key = next(k for k in {**one, **other} if one.get(k) != other.get(k))
    return _difference(one.get(key), other.get(key), f"{place}.{key}" if place else key)


def _write_new(file: Path, document: Mapping[str, Any]) -> None:
    head = {
        "schema": SCHEMA,
        "agentflow": __version__,
        "constants": constants().digest,
        "engine": str(default_engine().identity),
        "begun": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }
    text = yaml.safe_dump({**head, **document}, sort_keys=False)
    try:
        with write_atomically(file) as part:
            part.write_text(text, encoding="utf-8")
    except OSError as error:
        raise _unwritable(file.parent, error) from None


def _unwritable(path: Path, error: OSError) -> RunError:
    return RunError(f"cannot write to {path}: {error.strerror}; choose another folder with --out")


def folder_name(name: str, sweep: SweepConfig) -> str:
    """A folder for a sweep: its name, with the model's where a model is asked."""
    model = build(sweep.base).model.name
    kept = "".join(c if c.isalnum() or c in "._-" else "-" for c in model)
    return name if model == PROCEDURAL else f"{name}-{kept}"


def failures(path: Path) -> dict[str, str]:
    """Name of each run that failed when it was last tried -> why, in one line.

    Raises:
        RunError: The log is damaged.
    """
    found: dict[str, str] = {}
    log = path / LOG
    if not log.exists():
        return found
    for number, line in enumerate(log.read_bytes().splitlines(keepends=True), start=1):
        if not line.endswith(b"\n"):
            break
        try:
            item = json.loads(line)
            found.pop(item["run"], None)
            if item["state"] == "failed":
                found[item["run"]] = item["reason"]
        except (ValueError, KeyError, TypeError):
            raise RunError(f"{log} is damaged in line {number}") from None
    return found

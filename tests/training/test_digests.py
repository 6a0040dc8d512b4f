"""Digests notice other pairs and other weights, and ignore where the files are."""

from __future__ import annotations

import shutil
from pathlib import Path

from agentflow.training.record import MOST_PARTS, PART, digest_model, digest_set


def test_every_byte_of_a_set_counts(tmp_path: Path) -> None:
    for name in ("train.jsonl", "dev.jsonl"):
        (tmp_path / name).write_text("x" * (PART + 9))
    (tmp_path / "README.md").write_text("")
    first = digest_set(tmp_path)
    (tmp_path / "README.md").write_text("words about it")
    assert digest_set(tmp_path) == first
    (tmp_path / "dev.jsonl").write_text("x" * (PART + 8) + "y")
    assert digest_set(tmp_path) != first


def test_a_model_has_the_digest_of_its_files(tmp_path: Path) -> None:
    model = tmp_path / "run" / "model"
    model.mkdir(parents=True)
    (model / "config.json").write_text("{}")
    (model / "model.safetensors").write_bytes(bytes(100))
    first = digest_model(model)
    assert digest_model(tmp_path / "run") == first, "the directory of its training names it"
    (model / ".lock").touch()
    (model / "films").mkdir()
    assert digest_model(shutil.copytree(model, tmp_path / "copy")) == first
    (model / "model.safetensors").write_bytes(bytes(99) + b"1")
    assert digest_model(model) != first


def test_of_a_large_file_parts_count_to_its_end(tmp_path: Path) -> None:
    (tmp_path / "config.json").write_text("{}")
    weights = tmp_path / "model.safetensors"
    with weights.open("wb") as file:
        file.truncate(3 * MOST_PARTS * PART)  # takes no room on the disk
    first = digest_model(tmp_path)
    with weights.open("r+b") as file:
        file.seek(3 * (MOST_PARTS - 1) * PART)
        file.write(b"1")
    assert digest_model(tmp_path) != first

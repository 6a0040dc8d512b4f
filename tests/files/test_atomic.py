"""Files are written completely or left unchanged."""

from __future__ import annotations

from pathlib import Path

import pytest

from agentflow.files.atomic import write_atomically


def fail(part: Path) -> None:
    part.write_text("half")
    (part.parent / "no" / "other").write_text("rest")


def test_a_file_is_replaced_on_success(tmp_path: Path) -> None:
    out = tmp_path / "page.html"
    out.write_text("old")
    with write_atomically(out) as part:
        part.write_text("new")
        assert out.read_text() == "old"
    assert out.read_text() == "new"
    assert list(tmp_path.iterdir()) == [out]


def test_failure_leaves_the_file_unchanged(tmp_path: Path) -> None:
    out = tmp_path / "page.html"
    out.write_text("old")
    with pytest.raises(FileNotFoundError), write_atomically(out) as part:
        fail(part)
    assert out.read_text() == "old"
    assert list(tmp_path.iterdir()) == [out]


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    link, real = tmp_path / "link", tmp_path / "real"
    link.symlink_to(real)
    with write_atomically(link) as part:
        part.write_text("new")
    assert link.is_symlink()
    assert real.read_text() == "new"


def test_devices_and_folders_are_never_replaced(tmp_path: Path) -> None:
    with write_atomically(Path("/dev/null")) as part:
        part.write_text("nothing")
    assert Path("/dev/null").is_char_device()
    with pytest.raises(IsADirectoryError), write_atomically(tmp_path) as part:
        part.write_text("nothing")

"""What may be read of the files that a program leaves, and what is refused."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest

from agentflow.integrations.external.folder import (
    LARGEST,
    MOST_FILES,
    MachineFile,
    MachineFiles,
    read_machine_files,
)

pytestmark = pytest.mark.skipif(os.name != "posix", reason="links, pipes and devices")
LINK = "it is a link; write the machine itself"
SPECIAL = "it is a pipe, a socket or a device; write a file"


def read(folder: Path) -> dict[str, str | None]:
    """Name -> text of each file."""
    found = read_machine_files(folder)
    assert found.problem == ""
    return {file.name: file.text for file in found.read}


def problem_of(folder: Path) -> str:
    """Why the only file is refused."""
    (file,) = read_machine_files(folder).read
    assert file.text is None
    return file.problem


def test_files_are_read_in_the_order_of_their_names(tmp_path: Path) -> None:
    for name in ("b.json", "a.json", "é.json", "notes.txt", ".hidden.json", "JSON"):
        (tmp_path / name).write_text(f"[{name}]", encoding="utf-8")
    names = ["a.json", "b.json", "é.json"]
    assert read(tmp_path) == {name: f"[{name}]" for name in names}
    assert list(read(tmp_path)) == names


def test_an_empty_folder_and_one_that_is_gone(tmp_path: Path) -> None:
    assert read_machine_files(tmp_path) == MachineFiles()
    gone = read_machine_files(tmp_path / "gone")
    assert gone == MachineFiles(problem="it cannot be read: No such file or directory")


def test_links_out_of_the_folder_are_not_followed(tmp_path: Path) -> None:
    folder = tmp_path / "machines"
    folder.mkdir()
    (folder / "x.json").symlink_to("/etc/passwd")
    assert problem_of(folder) == LINK


def test_a_second_name_of_a_file_elsewhere_is_a_link(tmp_path: Path) -> None:
    folder = tmp_path / "machines"
    folder.mkdir()
    (tmp_path / "secret").write_text("[]")
    os.link(tmp_path / "secret", folder / "x.json")
    assert problem_of(folder) == LINK


def test_a_folder_that_is_a_link_or_a_file_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "machines").symlink_to("/etc")
    (tmp_path / "file").touch()
    for name in ("machines", "file"):
        found = read_machine_files(tmp_path / name)
        assert found == MachineFiles(problem="it is not a folder; leave it as it is")


def test_pipes_sockets_devices_and_folders_are_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.json")
    (tmp_path / "b.json").mkdir()
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(os.path.relpath(tmp_path / "c.json"))  # absolute paths may be too long
    found = {file.name: file.problem for file in read_machine_files(tmp_path).read}
    assert found == {
        "a.json": SPECIAL,
        "b.json": "it is a folder; write a file",
        "c.json": SPECIAL,
    }


@pytest.mark.slow
def test_only_so_many_files_are_read(tmp_path: Path) -> None:
    for number in range(10_000):
        (tmp_path / f"{number:05d}.json").touch()
    found = read_machine_files(tmp_path)
    assert [file.name for file in found.read] == [f"{n:05d}.json" for n in range(MOST_FILES)]
    assert found.more == 10_000 - MOST_FILES


def test_a_huge_file_is_refused_without_reading_it_all(tmp_path: Path) -> None:
    with (tmp_path / "x.json").open("wb") as file:
        file.truncate(1 << 40)  # a terabyte of nothing
    assert problem_of(tmp_path) == (
        "it has more than 1,048,576 bytes; write one machine and nothing else"
    )
    (tmp_path / "x.json").write_text("[" + " " * (LARGEST - 2) + "]")
    assert len(read(tmp_path)["x.json"] or "") == LARGEST


def test_a_file_that_is_not_utf_8(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_bytes(b"[\xff]")
    assert problem_of(tmp_path) == "byte 2 is not UTF-8; write the machine as UTF-8 text"


@pytest.mark.skipif(os.getuid() == 0, reason="root may read everything")
def test_a_file_that_may_not_be_read(tmp_path: Path) -> None:
    (tmp_path / "x.json").touch(mode=0)
    assert problem_of(tmp_path) == "it cannot be read: Permission denied"


def test_names_are_fit_to_be_printed(tmp_path: Path) -> None:
    for name in (b"\x1b[2J.json", b"a\nb.json", b"\xff.json"):
        (tmp_path / os.fsdecode(name)).write_text("[]")
    names = [file.name for file in read_machine_files(tmp_path).read]
    assert sorted(names) == [r"\x1b[2J.json", r"\xff.json", r"a\nb.json"]
    assert read_machine_files(tmp_path).read[0] == MachineFile(r"\x1b[2J.json", "[]")

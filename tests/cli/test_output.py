"""What others wrote is shown and not obeyed."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from rich.table import Table
from rich.text import Text

from agentflow.cli import main
from agentflow.cli.display.output import columns, output
from agentflow.cli.display.show_machines import show_edit
from agentflow.cli.display.text import show_count

EVIL = "\x1b]0;title\x07\x1b[2J\u202e\r[bold]\nnext"
SHOWN = r"\x1b]0;title\x07\x1b[2J\u202e\r[bold]"


def test_text_by_others_is_shown_whole_and_as_text(capsys: pytest.CaptureFixture[str]) -> None:
    table = columns("name")
    table.add_row(EVIL)
    console = output()
    console.print(table)
    console.print(EVIL)
    assert capsys.readouterr().out.split("\n") == [
        "name".ljust(len(SHOWN) + 6),
        f"{SHOWN}\\nnext",
        SHOWN,
        "next",
        "",
    ]


def test_no_way_of_showing_text_obeys_it(capsys: pytest.CaptureFixture[str]) -> None:
    """Styled text, heads of tables, plain tables."""
    plain = Table("name")
    plain.add_row(Text(EVIL))
    console = output()
    for shown in (Text(EVIL, style="bold"), columns(EVIL), plain):
        console.print(shown)
    out = capsys.readouterr().out
    assert out.count(r"\x1b]0;title") == 3
    assert all(c.isprintable() or c == "\n" for c in out)


def test_the_title_of_a_level_file_is_text(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    level = {"family": "movement", "title": EVIL, "good": 9}
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(level))
    assert main(["tasks", str(tmp_path / "own.yaml")]) == 0
    out = capsys.readouterr().out
    assert r"\x1b]0;title" in out
    assert all(c.isprintable() or c == "\n" for c in out)


def test_the_script_of_a_model_cannot_move_the_cursor(capsys: pytest.CaptureFixture[str]) -> None:
    step = {"verdict": "refused", "text": EVIL, "code": "unreadable", "reason": "no command"}
    show_edit({"steps": [step], "outcome": "failure"})
    assert capsys.readouterr().out == (
        f"refused: {SHOWN}\nnext\n  unreadable: no command\nfailure\n"
    )


def test_progress_is_every_tenth_line_without_a_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for of in (9, 25):
        show = show_count("film")
        for done in range(1, of + 1):
            show(done, of)
    lines = [3, 5, 8, 10, 13, 15, 18, 20, 23, 25]
    assert capsys.readouterr() == ("", "".join(f"agentflow: film {i} of 25\n" for i in lines))
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    show(1, 2)
    show(2, 2)
    assert capsys.readouterr().err == "agentflow: film 1 of 2\ragentflow: film 2 of 2\n"
    monkeypatch.setattr("sys.stderr", None)
    show(2, 2)


def test_in_a_narrow_terminal_no_digit_is_lost(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "6")
    table = columns("best", "of")
    table.add_row("11.13", "40")
    output().print(table)
    lines = capsys.readouterr().out
    assert "…" not in lines
    assert sorted(lines.replace("\n", "").replace(" ", "")) == sorted("bestof11.1340")

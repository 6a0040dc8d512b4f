"""What others wrote is shown and not obeyed."""

from __future__ import annotations

import pytest

from agentflow.cli.display.output import columns, output
from agentflow.cli.display.show import show_edit

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


def test_the_script_of_a_model_cannot_move_the_cursor(capsys: pytest.CaptureFixture[str]) -> None:
    step = {"verdict": "refused", "text": EVIL, "code": "unreadable", "reason": "no command"}
    show_edit({"steps": [step], "outcome": "failure"})
    assert capsys.readouterr().out == (
        f"refused: {SHOWN}\nnext\n  unreadable: no command\nfailure\n"
    )


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

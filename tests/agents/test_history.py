"""The bounded edit history."""

from __future__ import annotations

from agentflow.agents.history import EditRecord, History


def _history(scores: list[float | None]) -> History:
    history = History()
    for i, score in enumerate(scores):
        history = history.add(EditRecord(f"Remove {i}", "Success", before=1.0, after=score))
    return history


def test_text() -> None:
    history = (
        History()
        .add(EditRecord("Add 15 to 3 in 0\nRemove 7", "Success", before=None, after=4.256))
        .add(
            EditRecord(
                "Move 2 to 1 in 0", "Error", "Move 2 to 1 in 0: Error (face_occupied)", 4.256
            )
        )
        .add(EditRecord("Remove 4", "Success", "", 4.256, 1.0))
    )
    assert history.to_text() == (
        "1. Success, score none -> 4.26, best so far\n"
        "   Add 15 to 3 in 0\n"
        "   Remove 7\n"
        "2. Error, score 4.26 -> none\n"
        "   Move 2 to 1 in 0\n"
        "   Move 2 to 1 in 0: Error (face_occupied)\n"
        "3. Success, score 4.26 -> 1.00, worst so far\n"
        "   Remove 4"
    )


def test_earlier_edits_are_told_in_the_numbering_of_the_current_machine() -> None:
    refused = (
        "The script failed; the machine is unchanged:\n"
        "Add 2 to 3 in 1: Success\n"
        "Move 3 to 1 in 0: Error (face_occupied: face 0 of block 1 (Log) is already taken)\n"
        "Remove 9: Unverified"
    )
    no_machine = "The machine is not valid:\n- block 1 (Log) and block 3 (Log) overlap by 1 m"
    ids: dict[int | str, tuple[int | str, ...]] = {1: ("Log (gone from ", 0, " in 1)"), 3: (2,)}
    history = (
        History()
        .add(EditRecord("Add 15 to 3 in 0 as a\nRemove 1\nnonsense 3", "Success"))
        .add(EditRecord("", "Error", refused))
        .add(EditRecord("", "Error", no_machine))
        .renumbered({**ids, "a": (8,)})
        .add(EditRecord("Remove 3", "Success"))
    )
    assert history.to_text() == (
        "1. Success, score none -> none\n"
        "   Add 15 to 2 in 0 as a\n"
        "   Remove Log (gone from 0 in 1)\n"
        "   nonsense 3\n"
        "2. Error, score none -> none\n"
        "   The script failed; the machine is unchanged:\n"
        "   Add 2 to 2 in 1: Success\n"
        "   Move 2 to Log (gone from 0 in 1) in 0: Error (face_occupied)\n"
        "   Remove 9: Unverified\n"
        "3. Error, score none -> none\n"
        "   The machine is not valid:\n"
        "   - Log (gone from 0 in 1) and block 2 (Log) overlap by 1 m\n"
        "4. Success, score none -> none\n"
        "   Remove 3"
    )


def test_what_else_changed_is_told() -> None:
    torn = {"first break": "Log off Hinge at 0.84 s", "release": "24 m/s at 41 degrees"}
    edit = EditRecord(
        "Remove 1", "Success", "", 4.0, 9.0, ({"release": "20 m/s at 41 degrees"}, torn)
    )
    same = EditRecord("Remove 2", "Success", "", 4.0, 4.0, (torn, torn))
    assert History().add(edit).add(same).to_text() == (
        "1. Success, score 4.00 -> 9.00, best so far; release 20 m/s at 41 degrees -> 24 m/s at 41 "
        "degrees; first break none -> Log off Hinge at 0.84 s\n"
        "   Remove 1\n"
        "2. Success, score 4.00 -> 4.00, worst so far\n"
        "   Remove 2"
    )


def test_empty_text() -> None:
    assert History().to_text() == ""


def test_newest_best_and_worst_stay() -> None:
    scores: list[float | None] = [5.0, 9.0, 3.0, 0.0, *[5.0] * 30, None]
    history = _history(scores)
    assert [item.number for item in history.entries] == [2, 4, *range(18, 36)]


def test_earlier_of_equals_is_the_best() -> None:
    history = _history([1.0, 2.0, 2.0, 1.0, *[1.5] * 18])
    assert [item.number for item in history.entries] == [1, 2, *range(5, 23)]


def test_long_scripts_are_cut() -> None:
    text = History().add(EditRecord("x" * 1000 + "\n" + "Remove 1\n" * 50, "Error")).to_text()
    lines = text.splitlines()
    assert len(lines) == 22
    assert lines[1] == "   " + "x" * 300
    assert lines[-1] == "   ..."

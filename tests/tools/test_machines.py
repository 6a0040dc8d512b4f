"""Names of machines, and how many a run keeps."""

from __future__ import annotations

import pytest

from agentflow.machine.tree import ROOT, Machine, Step
from agentflow.tools.results import RefusedCall
from agentflow.tools.workspace import KnownMachines


def one(face: int) -> Machine:
    return Machine((ROOT, Step(1, 15, 0, face)))


def test_a_machine_is_found_by_its_name_or_its_whole_hash() -> None:
    known = KnownMachines()
    made = known.add(one(0))
    again = known.add(one(0), "parent", "script")
    assert again is made
    assert again.parent == ""
    assert made.name == one(0).digest[:8]
    for text in (made.name, f" {made.name.upper()}\n", one(0).digest):
        assert known.find(text) is made


def test_an_unknown_name_is_refused_with_the_newest_names() -> None:
    known = KnownMachines()
    names = [known.add(one(face)).name for face in range(6)]
    with pytest.raises(RefusedCall) as caught:
        known.find("x" * 500)
    newest = ", ".join(names[:0:-1])
    assert str(caught.value) == (
        f"there is no machine '{'x' * 40}'; the newest are {newest}; `check` and `edit` name "
        "machines, `history` lists them"
    )


def test_a_run_keeps_a_limited_number() -> None:
    known = KnownMachines(most=2)
    for face in (0, 1, 0):
        known.add(one(face))
    with pytest.raises(RefusedCall, match=r"^a run keeps at most 2 machines; continue with these$"):
        known.add(one(2))
    assert len(known) == 2

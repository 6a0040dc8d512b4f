"""Pictures of the documentation that a command draws are as it draws them now."""

from __future__ import annotations

from benchmarks import annotated_machine
from tests.test_documented import ROOT


def test_the_annotated_machine_is_current() -> None:
    assert (ROOT / annotated_machine.OUT).read_text("utf-8") == annotated_machine.drawn()

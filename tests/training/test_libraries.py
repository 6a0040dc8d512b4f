"""The libraries of the extra `train`, in the versions that `scripts/servers` names."""

from __future__ import annotations

import re
from importlib.metadata import version
from pathlib import Path

import pytest

SERVERS = Path(__file__).parents[2] / "scripts" / "servers"
PINS = dict(re.findall(r'"(torch|trl|transformers|peft|datasets)==([0-9.]+)"', SERVERS.read_text()))


@pytest.mark.training
@pytest.mark.parametrize("library", PINS)
def test_the_environment_holds_the_versions_that_the_script_names(library: str) -> None:
    assert version(library).partition("+")[0] == PINS[library]


def test_the_script_names_what_training_rests_on() -> None:
    assert {"torch", "trl"} <= set(PINS)

"""Prompt sets: strictness, one pass, content hash."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

from agentflow.errors import PromptError, UnknownNameError
from agentflow.machine.blocks.library import library
from agentflow.prompts.registry import PROMPT_SETS
from agentflow.prompts.render import PromptSet, block_functions

ROLES = (
    *("agent", "analyst", "designer", "drafter", "inspector", "meta_designer", "placer", "querier"),
    "refiner",
)


def test_sets_and_roles() -> None:
    assert PROMPT_SETS.ours == ("compact", "default", "no_geometry", "no_motion")
    for name in PROMPT_SETS:
        assert PromptSet(name).roles == ROLES
        assert PromptSet(name).about.endswith(".")


def test_a_set_has_the_templates_of_its_base_but_its_own_digest() -> None:
    base, without = PromptSet(), PromptSet("no_motion")
    assert base.files.keys() == without.files.keys()
    different = [path for path in base.files if base.files[path] != without.files[path]]
    assert different == ["_parts/motion.j2"]
    assert len({PromptSet(name).digest for name in PROMPT_SETS}) == len(PROMPT_SETS)


def test_unknown_names() -> None:
    with pytest.raises(UnknownNameError, match=r"^unknown prompt set 'defalt'; known: default, "):
        PromptSet("defalt")
    with pytest.raises(UnknownNameError, match=r"^unknown role 'refine'; known: refiner"):
        PromptSet().render("refine", {})


def test_missing_variable_names_template_and_variable() -> None:
    with pytest.raises(PromptError) as caught:
        PromptSet().render("querier", {"types": [2], "two_ended": [], "task": {"name": "t"}})
    assert str(caught.value) == (
        "prompt set 'default', _parts/task.j2, line 3: 'dict object' has no attribute 'objective'"
    )
    with pytest.raises(PromptError) as caught:
        PromptSet().render("querier", {"types": [2]})
    assert str(caught.value) == (
        "prompt set 'default', querier/system.j2, line 10: 'two_ended' is undefined; known: room, "
        "types"
    )


def test_inserted_text_is_not_rendered() -> None:
    assert "- {{ 7*7 }}{% raw %}" in PromptSet().retry("- {{ 7*7 }}{% raw %}")


def test_retry_says_what_is_wrong() -> None:
    assert PromptSet().retry("- block 3 overlaps\n## Task") == (
        "Your reply was not accepted:\n"
        "- block 3 overlaps\n"
        "> ## Task\n"
        "Correct this and send the complete reply again in the required format.\n"
    )


def test_digest_is_stable_and_of_the_content() -> None:
    digest = PromptSet().digest
    assert re.fullmatch("[0-9a-f]{16}", digest)
    assert PromptSet().digest == digest


def test_every_block_has_one_line() -> None:
    assert sorted(block_functions()) == sorted(library())
    for line in block_functions().values():
        assert line == " ".join(line.split())
        assert "|" not in line


def _cases() -> Iterator[tuple[int, str]]:
    for kind, block in library().items():
        if block.name.endswith("Wheel") and block.size and block.size[0] >= 2:
            yield kind, f"radius {block.size[0] / 2:g}"
        if block.pitch_radius:
            yield kind, f"pitch radius {block.pitch_radius:g}"
        if block.category == "Structure" and block.size and block.size[2] > 1:
            yield kind, f"{block.size[2]:g} long"


@pytest.mark.parametrize(("kind", "fact"), list(_cases()))
def test_functions_agree_with_the_library(kind: int, fact: str) -> None:
    assert fact in block_functions()[kind]

"""The generated pages and tables are as the code has them now, and cover all of it."""

from __future__ import annotations

import re
from collections import Counter
from typing import Any

import griffe
import pytest
from pydantic import BaseModel, Field

import agentflow
from agentflow.cli import command_group
from agentflow.config.run import DesignConfig
from agentflow.config.sweep import SweepConfig
from agentflow.machine.blocks.library import library
from docs.make import configuration, python
from docs.make.inserts import INSERTS, fill, marked
from docs.make.markdown import COMMAND, anchor, sentence
from docs.make.pages import DOCS
from docs.make.reference import outdated, reference


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    return {path.relative_to(DOCS).as_posix(): text for path, text in reference().items()}


def test_the_pages_are_current() -> None:
    names = [path.relative_to(DOCS).as_posix() for path in outdated()]
    assert not names, f"{', '.join(names)}: run {COMMAND}"


def test_every_command_and_option_is_there(pages: dict[str, str]) -> None:
    sections = dict(
        re.findall(
            r"(?ms)^##+ (agentflow[^\n]*)\n(.*?)(?=^##|\Z)", pages["reference/command-line.md"]
        )
    )

    def look(command: Any, path: str) -> None:
        for name, inner in getattr(command, "commands", {}).items():
            look(inner, f"{path} {name}")
        if not hasattr(command, "commands"):
            for option in command.params:
                spelling = (
                    option.opts[0] if option.param_type_name == "option" else option.name.upper()
                )
                assert f"| `{spelling}" in sections[path], (path, spelling)

    look(command_group(), "agentflow")
    assert len(sections) > 45


def test_every_configuration_key_is_there(pages: dict[str, str]) -> None:
    text = pages["reference/configuration.md"]
    for name in (*DesignConfig.model_fields, *SweepConfig.model_fields):
        assert f"| `{name}` | " in text, name
    assert "| `settings.search.ucb.scale` | `minmax`, `none` | `minmax` |" in text
    assert "| `workers` | integer, at least 1, at most 4096 | `2` |" in text
    assert "| `table.metrics` | list of text, not empty | required |" in text


def test_a_key_without_a_description_is_refused() -> None:
    class Lamp(BaseModel):
        colour: str = Field("red")

    part = configuration.Part("Lamps", "", Lamp)
    with pytest.raises(ValueError, match="the configuration key colour has no text"):
        configuration._keys(configuration.Group(part, "", Lamp), {})


def test_every_public_name_is_there(pages: dict[str, str]) -> None:
    text = pages["reference/python.md"]
    for name in agentflow.__all__:
        assert f"\n| [`{name}`](#" in text, name
    listed = python.documented()
    paths = Counter(item.path for items in listed.values() for item in items.values())
    assert set(paths.values()) == {1}
    for module, names in python.used_names().items():
        for name in names:
            assert python._find(module, name).path in paths, (module, name)


def test_every_attribute_of_the_package_has_a_meaning() -> None:
    for name, item in python.documented()["agentflow"].items():
        if isinstance(item, griffe.Class):
            for attribute, _, meaning in python._attributes(item):
                assert meaning, (name, attribute)


def test_fields_are_described_in_the_docstring_of_their_class() -> None:
    item = python._find("agentflow.search.settings", "UcbSettings")
    assert isinstance(item, griffe.Class)
    assert next(python._attributes(item)) == (
        "`c`",
        "`float`",
        "Exploration constant (published: 2).",
    )


def test_every_insert_is_on_one_page(pages: dict[str, str]) -> None:
    assert Counter(name for text in pages.values() for name in marked(text)) == Counter(
        list(INSERTS)
    )
    assert all(
        f"| {kind} | {block.name} |" in pages["reference/blocks.md"]
        for kind, block in library().items()
    )


def test_an_insert_replaces_what_is_between_its_marks() -> None:
    text = "before\n<!-- generated: blocks -->\nold\n<!-- end of blocks -->\nafter\n"
    filled = fill(text)
    assert filled.startswith("before\n<!-- generated: blocks -->\n\n| type | block |")
    assert filled.endswith("|\n\n<!-- end of blocks -->\nafter\n")
    assert "old" not in filled


def test_headings_have_the_anchors_of_github() -> None:
    assert anchor("Runs: `model.sampling.*`") == "runs-modelsampling"
    assert anchor("What a --set does, in `zsh`") == "what-a---set-does-in-zsh"


def test_descriptions_become_sentences() -> None:
    assert sentence("level, such as\n  throwing") == "Level, such as throwing."
    assert sentence("minmax: scaled") == "minmax: scaled."
    assert sentence("top_p, max_tokens ...") == "top_p, max_tokens ..."

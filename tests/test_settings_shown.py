"""Pages and the main configuration file show settings with their defaults and choices."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, get_args

import yaml

from agentflow.agents.registry import ROLES
from agentflow.config.run import DesignConfig
from agentflow.env.physics.registry import ENGINES
from agentflow.search.registry import STRATEGIES
from agentflow.workflows.registry import WORKFLOWS
from tests.pages import PAGES, named, page, rows

CONFIG = DesignConfig()
SETTINGS = CONFIG.settings


def test_all_roles_are_described() -> None:
    described = {cells[0].replace("-", "_") for cells in rows(page("prompts-and-roles.md"))}
    assert set(ROLES.ours) <= described


def test_all_workflows_and_strategies_are_described() -> None:
    text = page("explanation/search.md")
    assert {*WORKFLOWS.ours, *STRATEGIES.ours} <= named(text) | set(
        re.findall(r"^\*\*([\w-]+)\*\*", text, re.MULTILINE)
    )


def test_the_main_configuration_names_all_choices() -> None:
    lines = PAGES["configs/design.yaml"].splitlines()
    comments = {line.split(":")[0].strip(): line.partition("#")[2] for line in lines}
    for key, names in (("workflow", WORKFLOWS.ours), ("strategy", STRATEGIES.ours)):
        assert set(names) <= set(re.findall(r"[\w-]+", comments[key])), key
    assert {*ENGINES.ours} <= set(re.findall(r"\w+", comments["engine"]))


def test_the_main_configuration_has_the_defaults() -> None:
    def differ(given: object, default: object, path: str) -> Iterator[str]:
        if isinstance(given, dict) and isinstance(default, dict) and given:
            for key, item in given.items():
                yield from differ(item, default[key], f"{path}.{key}")
        elif given != default and (given or default):
            yield f"{path}: {given!r} is not {default!r}"

    shown = yaml.safe_load(PAGES["configs/design.yaml"])
    assert list(differ(shown, CONFIG.model_dump(mode="json"), "")) == []


def test_settings_of_searches_are_shown_with_their_defaults() -> None:
    shown = [
        cells for cells in rows(page("explanation/search.md")) if cells[0].startswith("`settings.")
    ]
    assert len(shown) >= 6
    for key, default, *_ in shown:
        value: Any = CONFIG
        for part in key.strip("`").split("."):
            value = getattr(value, part)
        text = f"{value:.4g}" if isinstance(value, float) else str(value)
        shown_text = default.strip("`")
        assert (shown_text.capitalize() if isinstance(value, bool) else shown_text) == text, key


def test_settings_of_roles_are_shown_with_their_choices() -> None:
    compared = set()
    for key, choices, *_ in rows(page("prompts-and-roles.md")):
        field = type(SETTINGS).model_fields.get(key.strip("`").removeprefix("settings."))
        members = get_args(field.annotation) if field and key.startswith("`settings.") else ()
        if members and all(isinstance(member, str) for member in members):
            assert named(choices) == set(members), key
            compared.add(key)
    assert len(compared) >= 5

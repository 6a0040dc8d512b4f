"""Configuration: precedence, and errors in keys."""

from __future__ import annotations

from pathlib import Path

import pytest

from agentflow.config.run import (
    DesignConfig,
    apply_settings,
    build_config,
    load_document,
    suggest_key,
)
from agentflow.errors import ConfigError

CONFIGS = [
    path
    for path in sorted((Path(__file__).parents[2] / "configs").glob("*.yaml"))
    if path.stem != "objectives" and "table" not in load_document(path)
]
"""Of single runs; those of sweeps and the list of objectives have tests of their own."""


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.name)
def test_every_shipped_configuration_is_valid(path: Path) -> None:
    build_config(load_document(path))


def test_settings_set_keys_switches_and_knobs() -> None:
    document = apply_settings(
        {"seed": 1, "settings": {"trajectories": 3}},
        ["seed=7", "search.ucb.c=2", "settings.inspector=off", "wall.height=0", "model.name=x"],
    )
    config = build_config(document)
    assert (config.seed, config.model.name) == (7, "x")
    assert config.settings.trajectories == 3
    assert config.settings.search.ucb.c == 2
    assert config.settings.inspector is False
    assert config.knobs == {"wall.height": 0}


@pytest.mark.parametrize(
    ("knob", "key"),
    [
        ("rounds", "search.rounds"),
        ("budget.calls", "model.budget.calls"),
        ("serach.rounds", "search.rounds"),
        ("sead", "seed"),
    ],
)
def test_keys_are_suggested_by_their_last_parts(knob: str, key: str) -> None:
    assert suggest_key(["wall.height", knob]) == f"; did you mean the configuration key {key!r}?"


def test_settings_leave_the_document_unchanged() -> None:
    document = {"settings": {"search": {"rounds": 2}}}
    apply_settings(document, ["search.rounds=9"])
    assert document == {"settings": {"search": {"rounds": 2}}}


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({"sed": 1}, "unknown configuration key 'sed'; known: seed, "),
        ({"seed": "x"}, "seed: expected a whole number, not 'x'"),
        ({"settings": {"trajectories": 0}}, "settings.trajectories: must be at least 1, not 0"),
        (
            {"settings": {"search": {"rounds": True}}},
            "settings.search.rounds: expected a number, not true or false",
        ),
        ({"settings": {"search": [1]}}, "settings.search: expected a group of keys, not [1]"),
        ({"settings": {"feedback": "x"}}, "settings.feedback: expected 'active', 'basic' or "),
        ({"settings": {"search": {"wdth": 1}}}, "unknown configuration key 'settings.search.wdth'"),
        ({"model": {"sampling": {"top": 1}}}, "unknown configuration key 'model.sampling.top'"),
    ],
)
def test_wrong_configuration_names_the_key(document: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        build_config(document)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("seed", "--set takes name=value, not 'seed'"),
        ("seed.x=1", "--set seed.x: seed is a single value, not a group of keys"),
        ("workflow.x=1", "--set workflow.x: workflow is a single value, not a group of keys"),
        ("seed=[", "--set seed: '[' is not a YAML value: line 1: expected the node"),
        (
            "search={width: 1, width: 2}",
            "--set search: '{width: 1, width: 2}' is not a YAML value: line 1: the key 'width' "
            "is duplicated",
        ),
    ],
)
def test_wrong_settings_are_refused(setting: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        apply_settings({"seed": 0}, [setting])
    assert str(caught.value).startswith(message)


def test_missing_files_and_invalid_yaml_are_reported(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot read"):
        load_document(tmp_path / "none.yaml")
    (tmp_path / "tab.yaml").write_text("task: throwing\n\tseed: 1\n")
    with pytest.raises(ConfigError, match=r"tab.yaml is not YAML: line 2: found character '\\t'"):
        load_document(tmp_path / "tab.yaml")
    (tmp_path / "twice.yaml").write_text("settings:\n  search: {rounds: 1}\n  search: {}\n")
    with pytest.raises(
        ConfigError, match=r"twice.yaml is not YAML: line 3: the key 'search' is duplicated"
    ):
        load_document(tmp_path / "twice.yaml")
    (tmp_path / "ring.yaml").write_text("task: movement\nknobs: {window: &a [*a]}\n")
    with pytest.raises(
        ConfigError,
        match=r"ring.yaml is not YAML: line 2: the alias 'a' stands inside what it names",
    ):
        load_document(tmp_path / "ring.yaml")
    bomb = [f"x{n}: &x{n} [{', '.join([f'*x{n - 1}'] * 9)}]" for n in range(1, 9)]
    (tmp_path / "bomb.yaml").write_text("\n".join(["x0: &x0 [1]", *bomb]))
    with pytest.raises(
        ConfigError,
        match=r"bomb.yaml is not YAML: line 7: .* it has more than 1,000,000 values",
    ):
        load_document(tmp_path / "bomb.yaml")
    (tmp_path / "alias.yaml").write_text("task: &a movement\nworkflow: *a\n")
    assert load_document(tmp_path / "alias.yaml") == {"task": "movement", "workflow": "movement"}
    (tmp_path / "bad.yaml").write_text("- a\n")
    with pytest.raises(ConfigError, match="must hold a mapping of configuration keys"):
        load_document(tmp_path / "bad.yaml")


def test_defaults_are_the_published_ones() -> None:
    config = DesignConfig()
    assert (config.task, config.workflow, config.settings.trajectories) == (
        "throwing",
        "hierarchical",
        8,
    )
    assert (config.model.sampling.temperature, config.model.sampling.top_p) == (0.7, 0.95)


def test_keys_are_short_and_dotted_in_files_as_on_the_command_line(tmp_path: Path) -> None:
    file = tmp_path / "short.yaml"
    file.write_text(
        "trajectories: 2\nsearch: {rounds: 1}\nsearch.width: 3\nmodel.name: x\n"
        "settings: {history: false, search: {strategy: random}}\n"
    )
    assert load_document(file) == {
        "settings": {
            "trajectories": 2,
            "search": {"rounds": 1, "width": 3, "strategy": "random"},
            "history": False,
        },
        "model": {"name": "x"},
    }
    file.write_text("title: A sweep\nbase: {trajectories: 2}\naxes: {}\n")
    assert load_document(file)["base"] == {"settings": {"trajectories": 2}}
    assert build_config({"trajectories": 2}).settings.trajectories == 2
    for twice in (
        {"trajectories": 2, "settings": {"trajectories": 3}},
        {"settings": {"search": {"rounds": 2}}, "search.rounds": 1},
    ):
        with pytest.raises(ConfigError, match=r"^settings\.\S+ is given twice: remove one of "):
            build_config(twice)
    with pytest.raises(ConfigError, match=r"^unknown configuration key 'trajectory'"):
        build_config({"trajectory": 2})
    with pytest.raises(ConfigError, match=r"^settings is a single value, not a group of keys$"):
        build_config({"settings": 3, "trajectories": 2})

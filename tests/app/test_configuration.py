"""Resolved configurations: every key, and the source of its value."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from agentflow.app.configuration import annotated_yaml, resolve_config
from agentflow.config.run import DesignConfig, build_config, load_document
from agentflow.errors import ConfigError
from agentflow.runs import RunDirectory


@pytest.fixture(autouse=True)
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("AGENTFLOW_MODEL", "OPENAI_BASE_URL"):
        monkeypatch.delenv(name, raising=False)


def origins(path: Path | None = None, *settings: str) -> dict[str, str]:
    found = resolve_config(path, settings)["from"]
    return {key: origin for key, origin in found.items() if origin != "default"}


def test_everything_is_default_without_settings() -> None:
    assert origins() == {}
    assert resolve_config(None, ())["config"] == DesignConfig().model_dump(mode="json")


def test_file_setting_and_environment_are_distinguished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AGENTFLOW_MODEL", "some-model")
    monkeypatch.setenv("OPENAI_BASE_URL", "http://me:secret@127.0.0.1:1/v1")
    file = tmp_path / "mine.yaml"
    file.write_text(
        "seed: 1\nknobs: {wall: {height: 2}}\nsettings: {trajectories: 3, search: {rounds: 2}}\n"
    )
    assert origins(file, "search.rounds=4", "search={width: 2}") == {
        "seed": str(file),
        "knobs.wall.height": str(file),
        "settings.trajectories": str(file),
        "settings.search.width": "--set",
        "model.name": "environment",
        "model.base_url": "environment",
    }
    assert origins(file, "seed=2", "model.name=other")["model.name"] == "--set"
    assert origins(file, "seed=2")["seed"] == "--set"
    assert "secret" not in annotated_yaml(resolve_config(file, ()))


def test_lists_and_empty_groups_have_one_origin() -> None:
    given = origins(None, "rationales=[a, 'b: c']", "model.roles={refiner: {name: x}}")
    assert given == {"settings.rationales": "--set", "model.roles.refiner.name": "--set"}


def test_the_output_is_a_valid_configuration() -> None:
    found = resolve_config(None, ("seed=7", "rationales=['a # b', \"c\\nd\"]", "wall.height=0"))
    text = annotated_yaml(found)
    assert yaml.safe_load(text) == found["config"]
    assert build_config(yaml.safe_load(text)).seed == 7
    for line in text.splitlines():
        assert line.endswith(":") or line.rsplit("# ")[-1] in ("default", "--set")


def test_invalid_configurations_are_refused() -> None:
    with pytest.raises(
        ConfigError, match=r"unknown knob 'sed' .*; did you mean the configuration key 'seed'"
    ):
        resolve_config(None, ("sed=1",))
    with pytest.raises(ConfigError, match=r"known: settings.search.rounds, "):
        resolve_config(None, ("search.round=1",))


def test_run_yaml_can_start_a_new_run(tmp_path: Path) -> None:
    config = DesignConfig(task="movement", seed=5)
    run = RunDirectory.create(tmp_path, "demo", {"config": config.model_dump(mode="json")})
    run.close()
    assert build_config(load_document(run.path / "run.yaml")) == config

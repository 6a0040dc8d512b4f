"""Configurations of training."""

from __future__ import annotations

from pathlib import Path

import pytest

from agentflow.errors import ConfigError
from agentflow.training.config import SftConfig, read_config
from tests.llm.foreign import ROOT

SHIPPED = sorted((ROOT / "configs" / "train").glob("sft_*.yaml"))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_configurations_are_valid(path: Path) -> None:
    assert read_config(SftConfig, path, (), {"data": "set"}).data == "set"


def test_options_override_settings_and_these_the_file() -> None:
    settings = ["steps=7", "data=other", "model.tiny.layers=2", "optimiser.learning_rate=1e-3"]
    found = read_config(SftConfig, SHIPPED[-1], settings, {"data": "set", "label": None})
    assert (found.steps, found.data, found.label) == (7, "set", None)
    assert found.optimiser.learning_rate == 1e-3
    assert found.model.tiny is not None
    assert (found.model.tiny.layers, found.model.tiny.hidden) == (2, 128)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (["stepz=7"], "unknown configuration key 'stepz'; known: steps"),
        (["model.tiny.width=7"], "unknown configuration key 'model.tiny.width'; known: "),
        (["steps=0"], "steps: must be at least 1, not 0"),
        (["steps=true"], "steps: expected a number, not true or false"),
        (["steps.x=1"], "steps: expected a whole number, not {'x': 1}"),
        (["steps"], "--set takes name=value, not 'steps'"),
        (["device=tpu"], "device: expected 'auto' or 'cpu', not 'tpu'"),
        (["model.name=x"], "model: give either tiny (a model from scratch) or name"),
        (["model.tiny=null"], "model: give either tiny (a model from scratch) or name"),
        (["peft={}"], "peft: give either lora or oft"),
        (["model.tiny.heads=5"], "hidden (128) must be an even multiple of heads (5)"),
        (["save_every=15"], "save_every (15) must be a multiple of log_every (20)"),
        (["max_tokens=600"], "max_tokens (600) must be at most model.tiny.positions (512)"),
        (["device_batch=5"], "batch (8) must be a multiple of device_batch"),
        (["optimiser.learning_rate=.inf"], "optimiser.learning_rate: expected a finite number"),
    ],
)
def test_what_is_wrong_is_named(settings: list[str], message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_config(SftConfig, ROOT / "configs/train/sft_tiny.yaml", settings, {"data": "set"})
    assert message in str(caught.value)


def test_a_data_set_must_be_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="data is missing"):
        read_config(SftConfig, ROOT / "configs/train/sft_tiny.yaml", (), {"data": None})
    with pytest.raises(ConfigError, match="cannot read"):
        read_config(SftConfig, tmp_path / "none.yaml", (), {})

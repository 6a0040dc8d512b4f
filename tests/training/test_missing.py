"""What commands say where the libraries of the extra `train` are missing."""

from __future__ import annotations

from pathlib import Path

import pytest

from agentflow.cli import main
from agentflow.errors import ConfigError
from agentflow.models.local.folder import ModelFolder, read_folder
from agentflow.models.local.libraries import require_libraries
from tests.llm.foreign import ROOT
from tests.training.libraries import INSTALLED

Captured = pytest.CaptureFixture[str]
INSTALL = "torch is not installed; install it with: pip install 'agentflow-machines[train]'"

without_training = pytest.mark.skipif(INSTALLED, reason="PyTorch is installed")


@without_training
@pytest.mark.parametrize("kind", ["sft", "grpo"])
def test_training_says_what_to_install(kind: str, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "out"
    config = ROOT / "configs" / "train" / f"{kind}_tiny.yaml"
    begins = ["--data", "set"] if kind == "sft" else ["--model", "model"]
    assert main(["train", kind, "--config", str(config), "--out", str(out), *begins]) == 2
    assert capsys.readouterr().err == f"agentflow: {INSTALL}\n"
    assert not out.exists()


@without_training
def test_designing_says_what_to_install_and_leaves_no_run(tmp_path: Path, capsys: Captured) -> None:
    model, runs = tmp_path / "model", tmp_path / "runs"
    model.mkdir()
    (model / "config.json").write_text("{}")
    ModelFolder(label="a tiny model", prompts="shorthand").save(model)
    assert main(["design", "--model", str(model), "--out", str(runs), "--quiet"]) == 2
    assert capsys.readouterr().err == f"agentflow: {INSTALL}\n"
    assert not runs.exists()


def test_a_folder_without_a_model_is_refused(tmp_path: Path, capsys: Captured) -> None:
    assert main(["design", "--model", str(tmp_path), "--out", str(tmp_path / "runs")]) == 2
    assert f"{tmp_path} holds no model: it has neither config.json nor" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"label": "x", "prompts": "songs"}', "prompts: expected 'chat' or 'shorthand', not"),
        ('{"label": "x", "extra": 1}', "unknown key 'extra'; known: label"),
    ],
)
def test_a_damaged_description_of_a_model_is_named(
    text: str, message: str, tmp_path: Path, capsys: Captured
) -> None:
    (tmp_path / "config.json").write_text("{}")
    (tmp_path / "agentflow.json").write_text(text)
    assert main(["design", "--model", str(tmp_path), "--out", str(tmp_path / "runs")]) == 2
    assert f"{tmp_path / 'agentflow.json'}: {message}" in capsys.readouterr().err


def test_a_description_that_is_no_json_is_named(tmp_path: Path) -> None:
    (tmp_path / "config.json").write_text("{}")
    (tmp_path / "agentflow.json").write_text("{")
    with pytest.raises(ConfigError, match="json is not a JSON object"):
        read_folder(tmp_path)


def test_a_library_outside_the_extra_is_named_alone() -> None:
    with pytest.raises(ConfigError, match=r"bitsandbytes is not installed; .*pip install bitsandb"):
        require_libraries("bitsandbytes")


@pytest.mark.parametrize("asked", [["design", "--model"], ["evaluate", "--task", "throwing"]])
@pytest.mark.parametrize("start", ["", "./"])
def test_a_path_without_a_folder_is_no_name_at_an_endpoint(
    asked: list[str], start: str, tmp_path: Path, capsys: Captured
) -> None:
    name = f"{start or tmp_path}/no-model"
    assert main([*asked, name, "--out", str(tmp_path / "out")]) == 2
    said = f"agentflow: {name} is not a folder; name a model's folder, or a model\n"
    assert capsys.readouterr().err == said
    assert not (tmp_path / "out").exists()

"""Configurations of reinforcement learning: presets, schedules, clear refusals."""

from __future__ import annotations

from pathlib import Path

import pytest

from agentflow.cli import main
from agentflow.errors import ConfigError
from agentflow.training.config import read_config
from agentflow.training.grpo.config import AdvantageConfig, GrpoConfig
from tests.llm.foreign import ROOT
from tests.training.libraries import INSTALLED

TINY, REAL = (ROOT / "configs" / "train" / f"grpo_{size}.yaml" for size in ("tiny", "real"))

PKPO = "advantage={name: pkpo, scale: false}"


def read(path: Path, *settings: str) -> GrpoConfig:
    return read_config(GrpoConfig, path, settings, {"model.name": "model"})


def test_the_real_preset_has_the_published_settings() -> None:
    config = read(REAL)
    assert (config.prompts, config.samples, config.steps, config.max_tokens) == (8, 64, 400, 1168)
    assert (config.temperature, config.top_p, config.kl) == (1.0, 0.95, 0.001)
    assert (config.clip, config.clip_high) == (0.2, 0.28)
    assert (config.optimiser.learning_rate, config.optimiser.gradient_norm) == (5e-6, 0.5)
    assert config.peft is not None
    assert config.peft.lora is not None
    assert config.peft.lora.rank == 64
    assert (config.reward, config.advantage.name) == ("performance", "best")
    assert set(config.libraries) - set(read(TINY).libraries) == {"vllm"}
    assert "gensim" in config.libraries, "evaluations between steps measure diversity"


def test_the_tiny_preset_fits_two_processor_cores() -> None:
    config = read(TINY)
    assert (config.batch, config.device, config.workers) == (64, "cpu", 2)
    assert (config.reward, config.kl, config.loss) == ("shaped", 0, "dr_grpo")
    assert config.advantage == AdvantageConfig(name="pass1", scale=True)
    assert (config.part, read(TINY, "samples=2").part) == (16, 8)


def test_k_may_follow_a_schedule() -> None:
    config = read(TINY, PKPO, "advantage.k={0: 8, 20: 4, 30: 1}")
    found = [config.advantage.k_at(step) for step in (0, 19, 20, 29, 30, 99)]
    assert found == [8, 8, 4, 4, 1, 1]
    assert AdvantageConfig(name="maxpo", k=3).k_at(7) == 3


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("advantage.name=ppo", "advantage.name: expected 'pass1', 'best', 'pkpo' or 'maxpo'"),
        (
            "advantage={name: pkpo, k: 17, scale: false}",
            "advantage.k must be 1 to 16 for pkpo with samples = 16, not 17",
        ),
        (
            "advantage={name: maxpo, k: 16, scale: false}",
            "advantage.k must be 1 to 15 for maxpo with samples = 16, not 16",
        ),
        (
            "advantage={name: pkpo, k: {0: 4, 9: 0}, scale: false}",
            "advantage.k must be 1 to 16 for pkpo",
        ),
        ("advantage.k={5: 4}", "a schedule of k must start at step 0"),
        ("samples=1", "samples: must be at least 2, not 1"),
        ("device_batch=48", r"prompts \* samples \(64\) must be a multiple of device_batch \(48\)"),
        ("reward=points", "reward: expected 'performance' or 'shaped', not 'points'"),
        ("rate=3", "unknown configuration key 'rate'"),
        ("fresh=true kl=0.1", "kl must be 0 with fresh"),
        ("advantage.name=best", "scale is for pass1 only: set advantage.scale=false for best"),
    ],
)
def test_what_is_wrong_is_named_in_one_sentence(setting: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        read(TINY, *setting.split(" ") if "{" not in setting else (setting,))


@pytest.mark.parametrize(
    "wanted",
    [
        pytest.param("cannot load the model '/nowhere'", marks=pytest.mark.training),
        pytest.param(
            "pip install 'agentflow-machines[train]'",
            marks=pytest.mark.skipif(INSTALLED, reason="it is installed"),
        ),
    ],
)
def test_the_command_says_what_is_missing(
    wanted: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--config", str(TINY), "--out", str(tmp_path / "out"), "--model", "/nowhere"]
    assert main(["train", "grpo", *out]) == 2
    told = capsys.readouterr().err
    assert wanted in told
    assert told.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_entropy_is_passed_through() -> None:
    options = read(TINY).entropy.options
    assert (options["entropy_coef"], options["use_adaptive_entropy"]) == (0, False)
    options = read(TINY, "entropy={weight: 0.01, target: 0.1, quantile: 0.2}").entropy.options
    assert options["use_adaptive_entropy"]
    assert (options["entropy_target"], options["top_entropy_quantile"]) == (0.1, 0.2)


def test_a_model_must_be_named() -> None:
    with pytest.raises(ConfigError, match="model is missing"):
        read_config(GrpoConfig, TINY, (), {})
    with pytest.raises(ConfigError, match="model must name a folder with a model"):
        read_config(GrpoConfig, TINY, ["model={tiny: {}}"], {})

"""The recipes are read by the loaders of the libraries that they are for, and name what exists."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

from agentflow.training.config import SftConfig, read_config
from agentflow.training.grpo.config import GrpoConfig

ROOT = Path(__file__).parents[2]
RECIPES = ROOT / "recipes"
JOBS = sorted((RECIPES / "slurm").glob("*.sbatch"))

LIBRARIES = ("trl", "verl")
PROMPTS, REPLIES = 8, 64
"""A step of the published training."""
OPTIONS = {
    *("job-name", "nodes", "ntasks", "ntasks-per-node", "gpus-per-node", "cpus-per-task", "mem"),
    *("exclusive", "time", "output", "signal"),
}
"""Those of the options of sbatch, as in its manual page, that the jobs use."""


def test_all_recipes_and_the_preset_train_the_same_adapter() -> None:
    trl, verl = (yaml.safe_load((RECIPES / name / "grpo.yaml").read_text()) for name in LIBRARIES)
    policy = verl["actor_rollout_ref"]["model"]
    preset = ROOT / "configs" / "train" / "grpo_real.yaml"
    ours = read_config(GrpoConfig, preset, (), {"model.name": "m"}).peft
    assert ours is not None
    assert ours.lora is not None
    found = (ours.lora.rank, ours.lora.alpha)
    assert found == (trl["lora_r"], trl["lora_alpha"]) == (64, 64)
    assert found == (policy["lora_rank"], policy["lora_alpha"])


@pytest.mark.training
@pytest.mark.slow
def test_trl_reads_its_recipe_and_finds_the_reward(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from accelerate.commands.config.config_args import load_config_from_file
    from trl import get_dataset
    from trl.import_utils import is_vllm_available
    from trl.scripts.grpo import make_parser

    from agentflow.integrations.trl import simulation_reward
    from agentflow.training.data.exchange import write_prompts

    arguments = ["--config", str(RECIPES / "trl" / "grpo.yaml"), "--bf16", "false"]
    read = make_parser().parse_args_and_config([*arguments, "--use_cpu", "true"])
    script, training, model, data = read[:4]
    [name] = script.reward_funcs
    assert name == f"{simulation_reward.__module__}.{simulation_reward.__name__}"
    monkeypatch.setattr("datasets.config.HF_DATASETS_CACHE", str(tmp_path / "cache"))
    data.datasets[0].data_files = str(tmp_path / "prompts.parquet")
    write_prompts(tmp_path / "prompts.parquet", ["throwing", "movement"], 4, "auto")
    rows = get_dataset(data)["train"]
    assert list(zip(rows["task"], rows["seed"], strict=True))[1:3] == [
        ("movement", 1),
        ("throwing", 2),
    ]
    texts = [[{"role": "assistant", "content": "I would build a car."}]] * 4
    assert simulation_reward(texts, list(rows["task"]), list(rows["seed"])) == [0.0] * 4
    assert (model.lora_r, model.lora_target_modules) == (64, "all-linear")
    assert training.use_vllm
    assert not is_vllm_available()  # so that this is all there is to check here

    cluster: Any = load_config_from_file(str(RECIPES / "trl" / "accelerate.yaml"))
    each = training.per_device_train_batch_size * training.gradient_accumulation_steps
    assert cluster.num_processes * each == PROMPTS * REPLIES
    assert training.num_generations == REPLIES
    assert cluster.deepspeed_config["zero_stage"] == 2


@pytest.mark.training
@pytest.mark.slow
def test_verl_accepts_its_recipe_and_finds_the_reward() -> None:
    from hydra import compose, initialize_config_dir
    from verl.trainer.ppo.reward import get_custom_reward_fn
    from verl.trainer.ppo.utils import need_reference_policy
    from verl.utils.config import validate_config

    defaults = "hydra.searchpath=[pkg://verl.trainer.config]"  # where main_ppo looks by itself
    with initialize_config_dir(str(RECIPES / "verl"), version_base=None):
        config = compose("grpo", overrides=[defaults])
    assert config.data.train_batch_size == PROMPTS
    assert config.actor_rollout_ref.rollout.n == REPLIES
    assert need_reference_policy(config)
    scores = get_custom_reward_fn(config)("agentflow", "I would build a car.", "movement")
    assert scores == {"score": 0.0, "parsed": 0.0, "spatial": 0.0, "valid": 0.0}

    config.actor_rollout_ref.model.lora_rank = 0  # with LoRA, validation imports vLLM
    validate_config(config, use_reference_policy=True, use_critic=False)
    config.data.train_batch_size = 7  # less than an update takes
    with pytest.raises(ValueError, match="train_batch_size"):
        validate_config(config, use_reference_policy=True, use_critic=False)


@pytest.mark.training
@pytest.mark.slow
def test_ray_accepts_its_recipe() -> None:
    from jsonschema import ValidationError
    from ray.autoscaler._private.util import prepare_config, validate_config
    from ray.runtime_env import RuntimeEnv

    given = yaml.safe_load((RECIPES / "ray" / "cluster.yaml").read_text(encoding="utf-8"))
    cluster = prepare_config(given)
    validate_config(cluster)
    with pytest.raises(ValidationError):
        validate_config({**cluster, "min_worker": 2})
    job = RuntimeEnv(**yaml.safe_load((RECIPES / "ray" / "job.yaml").read_text(encoding="utf-8")))
    assert job.env_vars()["OMP_NUM_THREADS"] == "1"


@pytest.mark.parametrize("job", JOBS, ids=lambda path: path.name)
def test_slurm_jobs_are_scripts_with_known_options(job: Path) -> None:
    bash = shutil.which("bash")
    assert bash
    subprocess.run([bash, "-n", str(job)], check=True)
    lines = job.read_text(encoding="utf-8").splitlines()
    directives = [line for line in lines if line.startswith("#SBATCH")]
    first_command = next(i for i, line in enumerate(lines) if line and not line.startswith("#"))
    assert directives
    assert not any(line.startswith("#SBATCH") for line in lines[first_command:])  # ignored there
    options = [re.fullmatch(r"#SBATCH --([a-z-]+)(=\S+)?", line) for line in directives]
    assert {option[1] for option in options if option} <= OPTIONS
    assert all(options)


@pytest.mark.parametrize("job", JOBS, ids=lambda path: path.name)
def test_slurm_jobs_name_recipes_that_exist(job: Path) -> None:
    text = job.read_text(encoding="utf-8")
    named = set(re.findall(r"recipes/[\w/.]+", text)) - {f"recipes/slurm/{job.name}"}
    assert named
    assert all((ROOT / name).exists() for name in named)


def test_the_presets_for_one_gpu_belong_together() -> None:
    presets = ROOT / "configs" / "train"
    start = read_config(SftConfig, presets / "sft_gpu.yaml", (), {"data": "set"})
    improve = read_config(GrpoConfig, presets / "grpo_gpu.yaml", (), {"model.name": "model"})
    assert start.model.tiny is not None
    assert improve.max_tokens < start.model.tiny.positions == start.max_tokens
    assert (start.device, improve.device) == ("auto", "auto")
    assert improve.batch == PROMPTS * REPLIES

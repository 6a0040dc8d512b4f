"""Supervised fine-tuning from the command line: trained, killed, continued, used for designs."""

# ruff: noqa: E402 - a check comes before imports of libraries that may be missing
from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from tests.training.libraries import require_training

pytestmark = require_training()

import torch
from transformers import AutoModelForCausalLM, AutoTokenizer

from agentflow.api import design_prompt
from agentflow.cli import main
from agentflow.llm.messages import Message, Request, Sampling
from agentflow.models.local.folder import ModelFolder, read_folder
from agentflow.models.local.loading import LocalClient, load_model
from agentflow.training.config import SftConfig, read_config
from agentflow.training.model import make_decoder, train_tokenizer
from agentflow.training.record import About, TrainingRun, read_training
from agentflow.training.trainer import make_trainer, train_sft
from tests.llm.foreign import ROOT
from tests.training.sets import make_pairs, write_set

Captured = pytest.CaptureFixture[str]

CONFIG = ROOT / "configs" / "train" / "sft_tiny.yaml"
SHORT = Sampling(temperature=1, top_p=1, max_tokens=8)
LABEL = "tiny model from scratch, procedural data"
TINY = {"hidden": 32, "layers": 1, "heads": 2, "feed_forward": 32, "vocabulary": 400}
SMALL = {
    **{f"model.tiny.{key}": value for key, value in TINY.items()},
    "steps": 12,
    "batch": 4,
    "log_every": 2,
    "save_every": 4,
    "dev_every": 4,
    "threads": 1,
}


def options(**other: Any) -> list[str]:
    given = SMALL | {key.replace("__", "."): value for key, value in other.items()}
    return [word for key, value in given.items() for word in ("--set", f"{key}={value}")]


def sft(data: Path, out: Path, **other: Any) -> list[str]:
    command = ["train", "sft", "--config", str(CONFIG), "--data", str(data), "--out", str(out)]
    return [*command, *options(**other)]


def curve(out: Path) -> list[dict[str, Any]]:
    rows = read_training(out).curves
    return [{key: value for key, value in row.items() if key != "seconds"} for row in rows]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_set(tmp_path_factory.mktemp("sets") / "set")


@pytest.fixture(scope="module")
def trained(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model that was trained for a few steps."""
    out = tmp_path_factory.mktemp("training") / "sft"
    assert main(sft(data, out)) == 0
    return out


def test_a_training_directory_says_what_happened(trained: Path) -> None:
    record = read_training(trained)
    assert (record.about.kind, record.about.label) == ("sft", LABEL)
    assert record.config["model"]["tiny"] == {**TINY, "family": "llama", "positions": 512}
    assert [row["step"] for row in record.curves] == [1, 2, 4, 6, 8, 10, 12]
    assert {"loss", "token_accuracy", "entropy", "learning_rate"} <= record.curves[0].keys()
    assert [row["step"] for row in record.curves if "dev_loss" in row] == [4, 8, 12]
    assert record.curves[-1]["loss"] < record.curves[0]["loss"] - 0.2
    assert record.result is not None
    assert record.result["dev_loss"] == record.curves[-1]["dev_loss"]
    assert (record.result["pairs"], record.result["left_out"]) == (40, 0)
    assert record.result["parameters"] == record.result["trained_parameters"]


def test_a_set_of_one_objective_has_no_loss_on_others(data: Path, tmp_path: Path) -> None:
    shutil.copytree(data, tmp_path / "set")
    (tmp_path / "set" / "dev.jsonl").write_text("")
    assert main(sft(tmp_path / "set", tmp_path / "sft", steps=2, save_every=2)) == 0
    record = read_training(tmp_path / "sft")
    assert record.result is not None
    assert record.result["dev_loss"] is None
    assert not any("dev_loss" in row for row in record.curves)


def test_long_pairs_are_left_out_of_both_files(
    data: Path, tmp_path: Path, capsys: Captured
) -> None:
    shutil.copytree(data, tmp_path / "set")
    dev = tmp_path / "set" / "dev.jsonl"
    pairs = [json.loads(line) for line in dev.read_text().splitlines()]
    pairs[0]["messages"][-1]["content"] *= 9
    dev.write_text("".join(json.dumps(pair) + "\n" for pair in pairs))
    few = {"steps": 2, "save_every": 2, "dev_every": 2}
    assert main(sft(tmp_path / "set", tmp_path / "one", **few)) == 0
    assert "1 pairs of dev.jsonl are longer than 512 tokens and left out" in capsys.readouterr().err
    assert "dev_loss" in read_training(tmp_path / "one").curves[-1]
    dev.write_text(json.dumps(pairs[0]) + "\n")
    assert main([*sft(tmp_path / "set", tmp_path / "one", **few), "--resume"]) == 2
    assert f"the files of data have changed since {tmp_path / 'one'}" in capsys.readouterr().err
    assert main(sft(tmp_path / "set", tmp_path / "none", **few)) == 0
    assert "dev_loss" not in read_training(tmp_path / "none").curves[-1]


@pytest.mark.parametrize(
    ("gpus", "processes", "message"),
    [
        (2, "1", "uses one GPU, but 2 are visible: choose one, as in CUDA_VISIBLE_DEVICES=0;"),
        (1, "8", "is one process, but a launcher started 8 (WORLD_SIZE): start it without"),
    ],
)
def test_several_gpus_and_processes_are_refused(
    gpus: int, processes: str, message: str, data: Path, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: Captured,
) -> None:  # fmt: skip
    monkeypatch.setattr(torch.cuda, "device_count", lambda: gpus)
    monkeypatch.setenv("WORLD_SIZE", processes)
    assert main(sft(data, tmp_path / "sft", device="auto")) == 2
    told = capsys.readouterr().err
    assert message in told
    assert told.count("\n") == 1
    assert not (tmp_path / "sft").exists()


def test_transformers_load_the_model(trained: Path) -> None:
    tokenizer = AutoTokenizer.from_pretrained(trained / "model")
    model = AutoModelForCausalLM.from_pretrained(trained / "model")
    inputs = tokenizer("throw 0 1<design>", return_tensors="pt", return_token_type_ids=False)
    assert model.generate(**inputs, max_new_tokens=3).shape == (1, inputs["input_ids"].numel() + 3)


def test_samples_depend_on_the_seed_alone(trained: Path) -> None:
    sampler = load_model(trained, "cpu")
    prompt = design_prompt("throwing")
    torch.manual_seed(1)
    first = sampler.draw(prompt, 3, 5, SHORT)
    assert torch.initial_seed() == 1  # the caller's generator is left alone
    torch.manual_seed(2)
    assert sampler.draw(prompt, 3, 5, SHORT) == first
    assert sampler.draw(prompt, 3, 6, SHORT) != first
    assert len(set(first)) == 3
    likeliest = Sampling(temperature=0, max_tokens=8)
    greedy = [sampler.draw(prompt, 1, seed, likeliest) for seed in (0, 1)]
    assert greedy[0] == greedy[1]


def test_a_model_cannot_forbid_itself_to_repeat_blocks(trained: Path, tmp_path: Path) -> None:
    shutil.copytree(trained / "model", tmp_path / "model")
    file = tmp_path / "model" / "generation_config.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), "repetition_penalty": 9.0}))
    models = [load_model(path, "cpu") for path in (trained / "model", tmp_path / "model")]
    prompt = design_prompt("throwing")
    one, other = (m.draw(prompt, 1, 0, Sampling(temperature=0, max_tokens=40)) for m in models)
    assert one == other


def test_only_the_reply_is_learned(data: Path, tmp_path: Path) -> None:
    settings = [f"{key}={value}" for key, value in SMALL.items()]
    config = read_config(SftConfig, CONFIG, settings, {"data": str(data)})
    pairs = list(make_pairs("throwing", 6))
    folder = ModelFolder(label="x", prompts="shorthand")
    with TrainingRun.open(tmp_path, About(kind="sft", label="x"), config, resume=False) as run:
        trainer = make_trainer(config, folder, pairs, pairs, run, print)
    for row, pair in zip(trainer.train_dataset, pairs, strict=True):
        learned = [token for token in row["labels"] if token != -100]
        assert trainer.processing_class.decode(learned) == f"{pair.reply}<eos>"


def test_an_interrupted_training_goes_on_with_the_same_curve(
    data: Path, trained: Path, tmp_path: Path
) -> None:
    def stop(line: str) -> None:
        if line.startswith("step 6 of 12"):
            raise KeyboardInterrupt

    settings = [f"{key}={value}" for key, value in SMALL.items()]
    config = read_config(SftConfig, CONFIG, settings, {"data": str(data)})
    out = tmp_path / "sft"
    with pytest.raises(KeyboardInterrupt):
        train_sft(config, out, resume=False, notify=stop)
    assert [row["step"] for row in curve(out)] == [1, 2, 4, 6]
    said: list[str] = []
    train_sft(config, out, resume=True, notify=said.append)
    assert said[0] == "continuing after checkpoint-4"
    assert curve(out) == curve(trained)
    weights = [path / "model" / "model.safetensors" for path in (out, trained)]
    assert weights[0].read_bytes() == weights[1].read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("trigger", ["curves.jsonl", "checkpoint-8/optimizer.pt"])
def test_a_killed_training_goes_on_with_the_same_curve(
    trigger: str, data: Path, trained: Path, tmp_path: Path
) -> None:
    out = tmp_path / "sft"
    code = "import sys; from agentflow.cli import main; sys.exit(main(sys.argv[1:]))"
    with subprocess.Popen([sys.executable, "-c", code, *sft(data, out)]) as process:
        while not (out / trigger).exists():
            assert process.poll() is None
            time.sleep(0.001)
        os.kill(process.pid, signal.SIGKILL)
    assert not (out / "result.json").exists()
    assert main([*sft(data, out), "--resume"]) == 0
    assert curve(out) == curve(trained)


def test_a_finished_training_is_not_repeated(data: Path, trained: Path, capsys: Captured) -> None:
    before = (trained / "curves.jsonl").read_bytes()
    assert main([*sft(data, trained), "--resume", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["model"] == str(trained / "model")
    assert (trained / "curves.jsonl").read_bytes() == before


def test_adapters_are_saved_alone_and_load_with_their_model(
    data: Path, trained: Path, tmp_path: Path
) -> None:
    for name, adapter in {"lora": "{lora: {rank: 2}}", "oft": "{oft: {block_size: 8}}"}.items():
        out = tmp_path / name
        base = {"model": f"{{name: {trained}, tiny: null}}", "peft": adapter}
        small = {key: value for key, value in SMALL.items() if not key.startswith("model.tiny")}
        words = [w for k, v in (small | base | {"steps": 4}).items() for w in ("--set", f"{k}={v}")]
        assert main(sft(data, out)[:8] + words) == 0
        assert (out / "model" / "adapter_config.json").exists()
        result = read_training(out).result
        assert result is not None
        assert result["trained_parameters"] < result["parameters"] / 2
        assert read_folder(out).label == f"{LABEL}, fine-tuned on procedural data"
        assert len(load_model(out, "cpu").draw(design_prompt("throwing"), 2, 0, SHORT)) == 2


@pytest.fixture(scope="module")
def designed(trained: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The result of a run with the trained model."""
    out = tmp_path_factory.mktemp("runs")
    few = ["--set", "trajectories=2", "--set", "max_retry=2", "--set", "verify=false"]
    command = ["design", "--task", "throwing", "--model", str(trained), "--out", str(out), *few]
    assert main([*command, "--quiet"]) == 0
    (run,) = out.iterdir()
    return {**json.loads((run / "result.json").read_text()), "run": str(run)}


def test_the_model_designs(designed: dict[str, Any]) -> None:
    assert (designed["model"], designed["workflow"]) == (LABEL, "single")
    assert (designed["calls"], designed["cost"]) == (4, 0)


def test_a_replay_needs_no_model(
    designed: dict[str, Any], trained: Path, capsys: Captured, tmp_path: Path
) -> None:
    moved = shutil.move(trained / "model", tmp_path / "elsewhere")
    try:
        assert main(["replay", designed["run"]]) == 0
    finally:
        shutil.move(moved, trained / "model")
    assert capsys.readouterr().out == "identical\n"


def test_it_says_that_nothing_revises_machines(
    trained: Path, tmp_path: Path, capsys: Captured
) -> None:
    few = ["--set", "trajectories=1", "--set", "max_retry=1", "--set", "verify=false"]
    assert main(["design", "--model", str(trained), "--out", str(tmp_path), *few]) == 0
    assert "writes whole machines and nothing else: workflow single, without revisions" in (
        capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--workflow", "hierarchical"], "asks it to be meta_designer and inspector and refiner;"),
        (["--set", "search.rounds=1"], "asks it to be refiner; use --workflow single"),
        (["--set", "representation=coordinates"], "writes whole machines as construction trees"),
    ],
)
def test_roles_that_it_cannot_play_are_refused(
    arguments: list[str], message: str, trained: Path, tmp_path: Path, capsys: Captured
) -> None:
    command = ["design", "--task", "throwing", "--model", str(trained), "--out", str(tmp_path)]
    assert main([*command, *arguments]) == 2
    assert message in capsys.readouterr().err


def test_commands_about_endpoints_name_the_folder(trained: Path, capsys: Captured) -> None:
    assert main(["doctor", "--model", str(trained)]) == 2
    assert f"the model in {trained}/model has no endpoint to check" in capsys.readouterr().err


async def test_a_chat_model_answers_every_role_through_its_template(tmp_path: Path) -> None:
    torch.manual_seed(0)
    prompt = design_prompt("throwing", role="inspector")
    tokenizer = train_tokenizer([message["content"] for message in prompt], 400)
    tokenizer.chat_template = (
        "{% for m in messages %}{{ m.role }}: {{ m.content }}\n{% endfor %}assistant:"
    )
    config = read_config(
        SftConfig, CONFIG, [f"model.tiny.{k}={v}" for k, v in TINY.items()], {"data": "x"}
    )
    assert config.model.tiny is not None
    wide = config.model.tiny.model_copy(update={"positions": 16384})
    make_decoder(wide, tokenizer).save_pretrained(tmp_path)
    tokenizer.save_pretrained(tmp_path)
    client = LocalClient(tmp_path, seed=0)
    assert client.name == tmp_path.name
    messages = tuple(
        Message.model_validate({"role": m["role"], "text": m["content"]}) for m in prompt
    )
    request = Request(
        role="inspector", label="a", messages=messages, sampling=Sampling(max_tokens=4)
    )
    replies = [await client.complete(request) for _ in range(2)]
    assert replies[0].text == replies[1].text
    assert (replies[0].finish, replies[0].usage.completion) == ("length", 4)
    other = await client.complete(request.model_copy(update={"label": "b"}))
    assert other.text != replies[0].text


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"data": "/nowhere"}, "cannot read /nowhere/train.jsonl"),
        ({"max_tokens": 16}, "is longer than max_tokens (16); the shortest has "),
        ({"model.tiny": "null", "model.name": "/nowhere"}, "cannot load the model '/nowhere'"),
    ],
)
def test_what_cannot_be_trained_is_named(
    change: dict[str, Any], message: str, data: Path, tmp_path: Path, capsys: Captured
) -> None:
    kept = {
        key: value
        for key, value in SMALL.items()
        if "model.tiny" not in change or not key.startswith("model.tiny")
    }
    words = [word for k, v in (kept | change).items() for word in ("--set", f"{k}={v}")]
    command = ["train", "sft", "--config", str(CONFIG), "--out", str(tmp_path / "out")]
    named = [] if "data" in change else ["--data", str(data)]
    assert main([*command, *named, *words]) == 2
    assert message in capsys.readouterr().err

"""Evaluations as users start them: with a model at an endpoint or the built-in one, interrupted."""

from __future__ import annotations

import asyncio
import json
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from agentflow.app.design.config import load_config
from agentflow.cli import main
from agentflow.errors import RunError, UnauthorisedError
from agentflow.extras import install
from agentflow.training.evaluation.evaluate import evaluate, random_seed
from agentflow.training.evaluation.record import EvaluationRecord, read_evaluation
from agentflow.training.evaluation.replies import JudgedReply
from tests.integrations.foreign import CAR
from tests.llm.foreign import ROOT
from tests.llm.hostile import body, completion, serving
from tests.training.folders import LABEL, throws, write_training
from tests.training.libraries import INSTALLED

Captured = pytest.CaptureFixture[str]
PROCEDURAL = ["evaluate", "procedural", "--task", "movement"]
FEW = [*PROCEDURAL, "--samples", "3", "--seed", "4"]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small evaluation of the built-in model."""
    out = tmp_path_factory.mktemp("evaluation") / "three"
    assert main([*FEW, "--out", str(out), "--json"]) == 0
    return out


def contents(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in out.iterdir()}


def copied(finished: Path, out: Path, *, samples: bytes) -> Path:
    """The evaluation as a kill would leave it: without results, with these lines of samples."""
    out.mkdir()
    for name, data in contents(finished).items():
        (out / name).write_bytes(data)
    (out / "samples.jsonl").write_bytes(samples)
    about = read_evaluation(out).model_copy(update={"results": None})
    (out / "evaluation.json").write_text(about.model_dump_json(indent=1) + "\n")
    return out


@pytest.mark.slow
def test_an_evaluation_is_numbers_and_judged_replies(finished: Path, capsys: Captured) -> None:
    lines = (finished / "samples.jsonl").read_bytes().splitlines()
    replies = [JudgedReply.model_validate_json(line) for line in lines]
    assert [(reply.task, reply.seed) for reply in replies] == [("movement", 4)] * 3
    assert len({reply.text for reply in replies}) == 3
    scores = [reply.score for reply in replies if reply.score is not None]
    assert len(scores) == 3
    assert main([*FEW, "--out", str(finished), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["name"], found["label"]) == ("three", "procedural (no language model)")
    row = found["results"]["movement"]
    assert row["mean"] == pytest.approx(sum(scores) / 3)
    assert row["max"] == max(scores)
    assert (row["valid"]["count"], row["valid"]["of"], row["faults"]) == (3, 3, 0)
    assert list(row["best_at"]) == ["1", "2"]
    assert main([*FEW, "--out", str(finished)]) == 0
    title, _, numbers, *_ = capsys.readouterr().out.splitlines()
    assert title.startswith("three: procedural (no language model), ")
    assert numbers.split()[:3] == ["movement", "3/3", "100.0%"]


@pytest.mark.slow
def test_settings_count_unless_an_option_says_otherwise(tmp_path: Path) -> None:
    given = ["seed=5", "model.sampling.temperature=0.3", "model.sampling.top_p=0.9"]
    settings = [word for setting in given for word in ("--set", setting)]
    asked = [*PROCEDURAL, "--samples", "1", "--out", str(tmp_path), *settings, "--top-p", "0.8"]
    assert main(asked) == 0
    found = read_evaluation(tmp_path)
    sampling = found.sampling
    assert (found.seed, sampling.temperature, sampling.top_p) == (5, 0.3, 0.8)


def test_a_spent_budget_stays_spent(tmp_path: Path, capsys: Captured) -> None:
    limit = ["--set", "model.budget.calls=2"]
    command = [*PROCEDURAL, "--samples", "5", "--out", str(tmp_path), *limit]
    for _ in range(2):
        assert main(command) == 2
        assert "call limit reached (2)" in capsys.readouterr().err
        assert len((tmp_path / "calls.jsonl").read_text().splitlines()) == 2


@pytest.mark.slow
@pytest.mark.parametrize("kept", [0, 2.5])
def test_an_interrupted_evaluation_continues_to_the_same_result(
    finished: Path, tmp_path: Path, kept: float
) -> None:
    lines = (finished / "samples.jsonl").read_bytes().splitlines(keepends=True)
    part = b"".join(lines[: int(kept)]) + (lines[int(kept)][:300] if kept % 1 else b"")
    out = copied(finished, tmp_path / "three", samples=part)
    assert main([*FEW, "--out", str(out), "--json"]) == 0
    assert contents(out) == contents(finished)


@pytest.mark.slow
def test_a_damaged_line_in_the_middle_is_named(
    finished: Path, tmp_path: Path, capsys: Captured
) -> None:
    lines = (finished / "samples.jsonl").read_bytes().splitlines(keepends=True)
    samples = lines[0] + lines[1][:200] + b"\n" + lines[2]
    out = copied(finished, tmp_path / "three", samples=samples)
    assert main([*FEW, "--out", str(out)]) == 2
    message = f"agentflow: {out / 'samples.jsonl'}, line 2 is damaged: it "
    assert capsys.readouterr().err.startswith(message)
    assert (out / "samples.jsonl").read_bytes() == samples


@pytest.mark.slow
def test_replies_of_another_evaluation_are_refused(
    finished: Path, tmp_path: Path, capsys: Captured
) -> None:
    samples = (finished / "samples.jsonl").read_bytes() * 2
    out = copied(finished, tmp_path / "three", samples=samples)
    assert main([*FEW, "--out", str(out)]) == 2
    assert "does not hold the replies of this evaluation in their order" in capsys.readouterr().err


def test_a_damaged_evaluation_json_is_named(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "evaluation.json").write_text('{"format": 1, "name"')
    assert main([*FEW, "--out", str(tmp_path)]) == 2
    message = f"agentflow: {tmp_path / 'evaluation.json'} is damaged: the file "
    assert capsys.readouterr().err.startswith(message)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["evaluate", "procedural", "--out", "OUT"],
            "name one task with --task, or several with --tasks",
        ),
        ([*PROCEDURAL, "--out", "OUT", "--tasks", "throwing"], "name one task with --task"),
        (
            ["evaluate", "procedural", "--tasks", "throwing,throwing", "--out", "OUT"],
            "each task may be named once, not as in throwing, throwing",
        ),
        (["evaluate", "procedural", "--task", "sailing", "--out", "OUT"], "unknown task 'sailing'"),
        (
            ["evaluate", str(ROOT), "--task", "throwing", "--out", "OUT"],
            f"{ROOT} holds no model: it has neither config.json nor",
        ),
        ([*PROCEDURAL, "--samples", "0", "--out", "OUT"], "Invalid value for '--samples'"),
        (
            [*PROCEDURAL, "--out", "OUT", "--set", "workflow=single"],
            "an evaluation has no workflow: it asks for whole machines, each in one reply; set "
            "only keys of model, knobs, prompts and engine",
        ),
    ],
)
def test_what_cannot_be_evaluated_is_named_and_leaves_nothing(
    arguments: list[str], message: str, tmp_path: Path, capsys: Captured
) -> None:
    out = tmp_path / "out"
    assert main([str(out) if word == "OUT" else word for word in arguments]) == 2
    assert capsys.readouterr().err.startswith(f"agentflow: {message}")
    assert not out.exists()


def test_another_evaluation_or_a_full_folder_is_not_overwritten(
    finished: Path, tmp_path: Path, capsys: Captured
) -> None:
    before = contents(finished)
    assert main([*PROCEDURAL, "--samples", "4", "--seed", "4", "--out", str(finished)]) == 2
    assert f"{finished} holds an evaluation with another samples: 3, not 4" in (
        capsys.readouterr().err
    )
    assert contents(finished) == before
    (tmp_path / "notes.txt").touch()
    assert main([*FEW, "--out", str(tmp_path)]) == 2
    assert f"{tmp_path} is not an evaluation: it has notes.txt" in capsys.readouterr().err


async def evaluate_at(base_url: str, out: Path) -> EvaluationRecord:
    """Five samples of a model at an endpoint, asked from a thread of its own."""
    options = {
        "model.name": "m",
        "model.base_url": base_url,
        "model.endpoint.retry.attempts": 1,
        "model.endpoint.limits.concurrent": 1,
    }
    config = load_config(None, (), options)
    return await asyncio.to_thread(evaluate, config, ["movement"], 5, out)


@pytest.mark.slow
async def test_an_endpoint_that_fails_after_half_is_asked_only_for_the_rest(
    tmp_path: Path,
) -> None:
    good, gone = body(completion(f"```json\n{CAR}\n```")), body({"error": "no"}, 401)
    async with serving(good, good, gone) as server:
        with pytest.raises(UnauthorisedError, match=r"run the same command again to continue$"):
            await evaluate_at(server.base_url, tmp_path)
        first = [asked.body["seed"] for asked in server.asked]
    assert read_evaluation(tmp_path).results is None
    async with serving(good) as server:
        found = await evaluate_at(server.base_url, tmp_path)
        second = [asked.body["seed"] for asked in server.asked]
    assert first[:2] == [random_seed(0, "movement", number) for number in (0, 1)]
    assert second == [random_seed(0, "movement", number) for number in (2, 3, 4)]
    assert found.results is not None
    row = found.results["movement"]
    assert (row["replies"], row["valid"]["count"], row["sd"]) == (5, 5, 0.0)


def test_the_designer_s_own_model_and_sampling_are_evaluated(tmp_path: Path) -> None:
    own = {"name": "procedural", "sampling": {"temperature": 0.5}}
    config = load_config(None, (), {"model.name": "m", "model.roles.designer": own})
    found = evaluate(config, ["movement"], 1, tmp_path)
    assert (found.model, found.label) == ("procedural", "procedural (no language model)")
    assert found.sampling.temperature == 0.5


@pytest.mark.slow
async def test_without_any_reply_another_model_may_take_the_folder(tmp_path: Path) -> None:
    async with serving(body({"error": "no"}, 401)) as server:
        with pytest.raises(UnauthorisedError):
            await evaluate_at(server.base_url, tmp_path)
    config = load_config(None, (), {"model.name": "procedural"})
    found = await asyncio.to_thread(evaluate, config, ["movement"], 1, tmp_path)
    assert found.model == "procedural"


def begin(out: Path) -> None:
    config = load_config(None, (), {"model.name": "procedural"})
    evaluate(config, ["movement", "throwing"], 5, out)


@pytest.mark.slow
def test_an_evaluation_killed_at_any_moment_gives_the_same_result(tmp_path: Path) -> None:
    begin(tmp_path / "undisturbed" / "it")
    expected = contents(tmp_path / "undisturbed" / "it")
    chance, context = random.Random(5), multiprocessing.get_context("spawn")
    for number, lines in enumerate((0, 5)):
        out = tmp_path / str(number) / "it"
        process = context.Process(target=begin, args=(out,))
        process.start()
        file = out / "samples.jsonl"
        while not file.exists() or file.read_bytes().count(b"\n") < lines:
            time.sleep(0.001)
        time.sleep(chance.uniform(0.0, 0.5))
        process.kill()
        process.join()
        begin(out)
        assert contents(out) == expected


@pytest.mark.training
def test_a_model_in_a_folder_repeats_itself_where_it_was_interrupted(
    tmp_path: Path, capsys: Captured
) -> None:
    import torch

    from agentflow.models.local.folder import ModelFolder
    from agentflow.training.config import TinyModel
    from agentflow.training.model import make_decoder, save_model, train_tokenizer

    run = write_training(tmp_path / "run")
    tokenizer = train_tokenizer([reply.text for reply in throws()], 300)
    decoder = make_decoder(TinyModel(hidden=16, layers=1, heads=2, feed_forward=16), tokenizer)
    save_model(decoder, tokenizer, ModelFolder(label=LABEL, prompts="shorthand"), run / "model")
    command = ["evaluate", str(run), "--task", "throwing", "--samples", "34", "--json"]
    command += ["--set", "model.sampling.max_tokens=12"]
    assert main([*command, "--out", str(tmp_path / "it")]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["label"], found["trained_on"]) == (LABEL, ["throwing"])
    assert (found["model"], found["results"]["throwing"]["replies"]) == (str(run / "model"), 34)
    lines = (tmp_path / "it" / "samples.jsonl").read_bytes().splitlines(keepends=True)
    assert len(set(lines)) > 30
    (tmp_path / "again").mkdir()
    again = copied(tmp_path / "it", tmp_path / "again" / "it", samples=b"".join(lines[:33]))
    assert main([*command, "--out", str(again)]) == 0
    assert contents(again) == contents(tmp_path / "it")
    assert "calls.jsonl" not in contents(again)

    torch.nn.init.ones_(decoder.lm_head.weight)
    decoder.save_pretrained(run / "model")
    assert main([*command, "--out", str(again)]) == 2
    told = capsys.readouterr().err
    assert f"the files of {run / 'model'} have changed since {again} was started" in told
    about = read_evaluation(again).model_copy(update={"files": None})  # as older ones
    (again / "evaluation.json").write_text(about.model_dump_json())
    assert main([*command, "--out", str(again)]) == 0


@pytest.mark.skipif(INSTALLED, reason="the libraries are there")
def test_without_the_libraries_a_folder_is_refused_and_leaves_nothing(
    tmp_path: Path, capsys: Captured
) -> None:
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "config.json").write_text("{}")
    command = ["evaluate", str(tmp_path / "model"), "--task", "throwing"]
    assert main([*command, "--out", str(tmp_path / "it")]) == 2
    told = f"agentflow: torch is not installed; install it with: {install('train')}\n"
    assert capsys.readouterr().err == told
    assert not (tmp_path / "it").exists()


INTERRUPTIBLE = """
import signal, sys
from agentflow.cli import main
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
def test_an_interrupted_evaluation_ends_and_says_how_to_continue(tmp_path: Path) -> None:
    out = tmp_path / "it"
    command = [*PROCEDURAL, "--samples", "64", "--out", str(out)]
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTIBLE, *command],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while not (out / "samples.jsonl").exists() or not (out / "samples.jsonl").stat().st_size:
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)  # while the second half is simulated
    _, told = process.communicate(timeout=120)
    assert process.returncode == 130
    assert told.endswith("agentflow: interrupted; run the same command again to continue\n")
    assert read_evaluation(out).results is None


def test_two_processes_cannot_evaluate_in_one_folder(finished: Path) -> None:
    from agentflow.training.evaluation.record import open_evaluation

    about = read_evaluation(finished)
    with (
        open_evaluation(finished, about),
        pytest.raises(RunError, match="is in use by another process"),
        open_evaluation(finished, about),
    ):
        pass

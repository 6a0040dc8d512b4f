"""Answers are recorded in order, continue after a stop, and say who gave them."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from random import Random

import pytest

from agentflow.cli import main
from agentflow.machine import check
from agentflow.training.data.generate import Answer, read_answers, split_reply

RUN = "import sys; from agentflow.cli import main; sys.exit(main(sys.argv[1:]))"
NAME = "procedural (no language model)"
Captured = pytest.CaptureFixture[str]


def generate(objectives: Path, out: Path, *options: str) -> list[str]:
    return ["data", "generate", str(objectives), "--out", str(out), "--quiet", *options]


def answers_in(out: Path) -> list[Answer]:
    return list(read_answers(out)[1])


def kill_until_done(command: list[str], log: Path, rng: Random, lines: int, kills: int) -> None:
    """Start a command again and again, and kill it whenever it has written some more lines."""
    for _ in range(kills):
        wanted = (log.read_bytes().count(b"\n") if log.exists() else 0) + rng.randint(1, lines)
        process = subprocess.Popen([sys.executable, "-c", RUN, *command], stdout=subprocess.DEVNULL)
        while process.poll() is None:
            if log.exists() and log.read_bytes().count(b"\n") >= wanted:
                os.kill(process.pid, signal.SIGKILL)
                break
            time.sleep(rng.random() * 0.002)
        if process.wait() == 0:
            return
    assert main(command) == 0


def test_answers_take_turns_and_have_variants(
    objectives: Path, tmp_path: Path, capsys: Captured
) -> None:
    options = ("--samples", "3", "--variants", "1.5", "--limit", "8", "--json")
    assert main(generate(objectives, tmp_path / "a", *options)) == 0
    found = json.loads(capsys.readouterr().out)
    answers = answers_in(tmp_path / "a")
    names = ["small-cart", "log-wagon", "statue"]
    assert [(a.objective, a.sample) for a in answers] == [(names[n % 3], n // 3) for n in range(8)]
    assert {answer.source for answer in answers} == {NAME}
    assert found == {
        "out": str(tmp_path / "a"),
        "model": NAME,
        "answers": 8,
        "planned": 8,
        "variants": sum(len(answer.variants) for answer in answers),
        "calls": 8,
        "tokens": 0,
        "cost": 0.0,
        "stopped": None,
    }
    assert {len(answer.variants) for answer in answers} == {1, 2}
    assert len({answer.program for answer in answers}) > 3
    plan, _ = read_answers(tmp_path / "a")
    briefs = {item.objective.name: item.objective.task.brief for item in plan.questions}
    for answer in answers:
        assert answer.rationale.startswith("Dimensions in blocks: ")
        assert "[" not in answer.rationale
        for machine in (answer.program, *map(list, answer.variants)):
            assert check(machine, briefs[answer.objective]).task_valid


def test_the_objectives_come_back_from_the_plan(objectives: Path, tmp_path: Path) -> None:
    from agentflow.training.objectives.objective import read_objectives

    main(generate(objectives, tmp_path / "a", "--samples", "1"))
    plan, _ = read_answers(tmp_path / "a")
    assert tuple(item.objective for item in plan.questions) == read_objectives(objectives)
    assert plan.questions[0].prompt[1].content.count("A handcart of planks and wheels") == 1


def test_the_same_command_continues_without_asking_again(objectives: Path, tmp_path: Path) -> None:
    command = generate(objectives, tmp_path / "a", "--samples", "4", "--variants", "1")
    assert main(command) == 0
    file, calls = tmp_path / "a" / "answers.jsonl", tmp_path / "a" / "calls.jsonl"
    whole, recorded = file.read_bytes(), calls.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    assert main(command) == 0
    assert (file.read_bytes(), calls.read_bytes()) == (whole, recorded)


@pytest.mark.slow
def test_a_killed_process_loses_nothing_but_the_reply_in_flight(
    objectives: Path, tmp_path: Path
) -> None:
    options = ("--samples", "60", "--variants", "0.5")
    assert main(generate(objectives, tmp_path / "whole", *options)) == 0
    killed = tmp_path / "killed"
    command = generate(objectives, killed, *options)
    kill_until_done(command, killed / "answers.jsonl", Random(0), lines=60, kills=5)
    for name in ("answers.jsonl", "plan.json"):
        assert (killed / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_a_budget_stops_and_says_so(objectives: Path, tmp_path: Path, capsys: Captured) -> None:
    options = ("--samples", "2", "--set", "model.budget.calls=4", "--workers", "1")
    assert main(generate(objectives, tmp_path / "a", *options)) == 0
    assert capsys.readouterr().out == (
        f"4 of 6 answers of {NAME}: {tmp_path / 'a'}\nstopped: call limit reached (4)\n"
    )
    assert main(generate(objectives, tmp_path / "a", "--samples", "2")) == 0
    assert len(answers_in(tmp_path / "a")) == 6


def test_other_plans_and_other_folders_are_refused(
    objectives: Path, tmp_path: Path, capsys: Captured
) -> None:
    out = tmp_path / "a"
    assert main(generate(objectives, out, "--samples", "1")) == 0
    capsys.readouterr()
    assert main(generate(objectives, out, "--samples", "2")) == 2
    assert capsys.readouterr().err == (
        f"agentflow: {out} was started with a different value of samples: repeat the command that "
        "started it, or choose another folder with --out\n"
    )
    assert main(generate(objectives, tmp_path, "--samples", "2")) == 2
    assert capsys.readouterr().err == (
        f"agentflow: {tmp_path} holds files, but no plan.json of this command; choose an empty "
        "folder with --out\n"
    )
    objectives.write_text("")
    assert main(generate(objectives, tmp_path / "b")) == 2
    assert capsys.readouterr().err == f"agentflow: {objectives} must be a list of objectives\n"
    assert not (tmp_path / "b").exists()


def test_settings_that_decide_nothing_are_refused(
    objectives: Path, tmp_path: Path, capsys: Captured
) -> None:
    assert main(generate(objectives, tmp_path / "a", "--set", "wall.height=0")) == 2
    assert capsys.readouterr().err == (
        "agentflow: answers to objectives have no knobs: set only keys of model, prompts and seed\n"
    )


def test_an_endpoint_that_cannot_be_reached_leaves_a_folder_that_can_be_used(
    objectives: Path, tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "none")
    out = tmp_path / "a"
    nowhere = ("--model", "m", "--base-url", "http://127.0.0.1:9/v1", "--samples", "1")
    once = ("--set", "model.endpoint.retry.attempts=1")
    assert main(generate(objectives, out, *nowhere, *once)) == 4
    assert capsys.readouterr().err.endswith("; repeat the command to continue\n")
    assert main(generate(objectives, out, "--samples", "1")) == 0
    assert {answer.source for answer in answers_in(out)} == {NAME}


@pytest.mark.parametrize(
    ("text", "rationale", "program"),
    [
        ("Why.\n```json\n[1]\n```\nThen.", "Why.\n\nThen.", "```json\n[1]\n```"),
        ("Why. [1, 2]", "Why.", "[1, 2]"),
        ("No machine.", "No machine.", ""),
        ("", "", ""),
        ("```json\n[1", "", "```json\n[1"),
        ("x" * 9000, "x" * 4000, ""),
        ("[" * 50_000, "", "[" * 50_000),
    ],
)
def test_rationale_and_program_are_kept_apart(text: str, rationale: str, program: str) -> None:
    assert split_reply(text) == (rationale, program)

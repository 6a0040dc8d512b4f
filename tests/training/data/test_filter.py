"""Only machines that work, are new and are not in the evaluation come into a set."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from random import Random

import pytest
import yaml

from agentflow.cli import main
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Feedback, Rollout
from agentflow.env.tasks.base import Task
from agentflow.machine import Machine, read_machine
from agentflow.training.data.contamination import tree_hash
from agentflow.training.data.folder import read_log
from agentflow.training.data.gates import GATES, Judgement
from agentflow.training.data.generate import read_answers
from agentflow.training.data.pairs import Pair, read_pairs
from tests.training.data.test_generate import generate, kill_until_done

pytest.importorskip("sklearn")
Captured = pytest.CaptureFixture[str]
NAME = "procedural (no language model)"


def filtered(answers: Path, out: Path, *options: str) -> list[str]:
    return ["data", "filter", str(answers), "--out", str(out), "--quiet", *options]


def pairs_in(out: Path) -> list[Pair]:
    return [*read_pairs(out / "train.jsonl"), *read_pairs(out / "dev.jsonl")]


def change_programs(folder: Path, programs: dict[int, str]) -> None:
    """Replace the programs of some answers."""
    lines = [json.loads(line) for line in (folder / "answers.jsonl").read_text().splitlines()]
    for number, program in programs.items():
        lines[number] |= {"program": program, "variants": []}
    text = "".join(json.dumps(line) + "\n" for line in lines)
    (folder / "answers.jsonl").write_text(text)


@pytest.mark.slow
def test_each_gate_drops_what_it_should(objectives: Path, tmp_path: Path, capsys: Captured) -> None:
    answers, out = tmp_path / "a", tmp_path / "set"
    extra = (
        objectives.read_text()
        + objectives.read_text()
        .replace("small-cart", "copied")
        .replace(
            "A handcart of planks and wheels drives away from where it stood.",
            "A machine that drives its Starting Block along z+ as far as possible.",
        )
        .split("- name: log-wagon")[0]
        .lstrip()
    )
    objectives.write_text(extra)
    assert main(generate(objectives, answers, "--samples", "3", "--variants", "1")) == 0
    good = json.loads((answers / "answers.jsonl").read_text().splitlines()[0])["program"]
    steps = [{"type": 15, "id": n, "parent": n - 1, "face_id": 0} for n in range(1, 21)]
    too_long = json.dumps([{"type": 0, "id": 0, "parent": -1, "face_id": -1}, *steps])
    change_programs(answers, {4: good, 5: too_long, 8: "<|im_end|>[" * 3000})
    emptied = {("log-wagon", 1), ("small-cart", 2)}
    capsys.readouterr()
    assert main(filtered(answers, out, "--json")) == 0
    card = json.loads(capsys.readouterr().out)
    judged = list(read_log(out / "judged.jsonl", Judgement))
    dropped = Counter(item.dropped for item in judged)
    assert {item.objective for item in judged if item.dropped == "objective"} == {"copied"}
    assert [(i.objective, i.sample) for i in judged if i.dropped == "parse"] == [("small-cart", 2)]
    assert [(i.objective, i.sample) for i in judged if i.dropped == "validity"] == [
        ("log-wagon", 1)
    ]
    assert ("small-cart", 1) in [(i.objective, i.sample) for i in judged if i.dropped]
    assert {i.dropped for i in judged if i.objective == "statue"} <= {
        "function",
        "duplicate",
        "original",
    }
    useless = {
        (i.objective, i.sample)
        for i in judged
        if i.dropped not in (None, "duplicate", "original") and not i.variant
    }
    original = {(i.objective, i.sample) for i in judged if i.dropped == "original"}
    assert original == {(o, n) for o, n in useless if o != "copied" and (o, n) not in emptied}
    entered = len(judged)
    for count in card["gates"]:
        assert (count["entered"], count["passed"]) == (entered, entered - dropped[count["gate"]])
        entered = count["passed"]
    assert [count["gate"] for count in card["gates"]] == list(GATES)
    assert entered == sum(card["pairs"].values()) == len(pairs_in(out)) > 3
    assert (card["model"], card["licence"], card["faults"]) == (NAME, "MIT", 0)


@pytest.mark.slow
def test_a_simulation_that_failed_makes_no_equal_machine_a_duplicate(
    objectives: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers, out = tmp_path / "a", tmp_path / "set"
    assert main(generate(objectives, answers, "--samples", "3", "--limit", "7")) == 0
    cart = json.loads((answers / "answers.jsonl").read_text().splitlines()[0])["program"]
    change_programs(answers, {3: cart, 6: cart})  # those of small-cart
    simulated = RolloutPool.run
    seen: list[str] = []

    async def slow_at_first(pool: RolloutPool, machine: Machine, task: Task) -> Rollout:
        seen.append(f"{task.name} {machine.digest}")
        if seen.count(seen[-1]) > 1:
            return await simulated(pool, machine, task)
        return Rollout("timeout", None, Feedback("", {}))

    monkeypatch.setattr(RolloutPool, "run", slow_at_first)
    assert main(filtered(answers, out)) == 0
    carts = [
        item.dropped
        for item in read_log(out / "judged.jsonl", Judgement)
        if item.objective == "small-cart"
    ]
    assert carts == ["simulation", None, "duplicate"]


@pytest.mark.slow
def test_the_pairs_hold_the_real_prompt_and_a_clean_reply(objectives: Path, tmp_path: Path) -> None:
    answers, out = tmp_path / "a", tmp_path / "set"
    assert main(generate(objectives, answers, "--samples", "2", "--variants", "1")) == 0
    assert main(filtered(answers, out)) == 0
    plan, _ = read_answers(answers)
    prompts = {item.objective.name: item.prompt for item in plan.questions}
    pairs = pairs_in(out)
    for pair in pairs:
        assert pair.prompt == prompts[pair.objective]
        machine = read_machine(pair.reply, (0, 1, 2, 15, 63)).machine
        assert machine is not None
        assert machine.to_json() == list(pair.machine)
        assert pair.reply.startswith(f"{pair.rationale}\n```json\n")
        assert pair.score is not None
        assert ("Changed: " in pair.rationale) == (pair.source == f"{NAME}, edited at random")
    trees = [tree_hash(read_machine(list(map(dict, pair.machine))).machine) for pair in pairs]
    assert len(set(trees)) == len(trees)
    train, dev = (
        {pair.objective for pair in read_pairs(out / name)} for name in ("train.jsonl", "dev.jsonl")
    )
    assert train
    assert dev
    assert not train & dev
    text = (out / "README.md").read_text()
    head = yaml.safe_load(text.split("---\n")[1])
    assert head["license"] == "mit"
    [files] = head["configs"]
    named = [(item["split"], item["path"]) for item in files["data_files"]]
    assert named == [("train", "train.jsonl"), ("validation", "dev.jsonl")]
    assert "100 objectives x 250 replies = 25,000, of which 9,982 pairs (40%) passed" in text
    assert f"Machines designed by: {NAME}" in text


@pytest.mark.slow
def test_a_finished_set_stays_as_it_is_and_another_is_refused(
    objectives: Path, tmp_path: Path, capsys: Captured
) -> None:
    answers, out = tmp_path / "a", tmp_path / "set"
    assert main(generate(objectives, answers, "--samples", "1")) == 0
    assert main(filtered(answers, out)) == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    assert main(filtered(answers, out)) == 0
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    capsys.readouterr()
    assert main(filtered(answers, out, "--licence", "CC0-1.0")) == 2
    assert capsys.readouterr().err == (
        f"agentflow: {out} was started with a different value of licence: repeat the command that "
        "started it, or choose another folder with --out\n"
    )
    assert main(filtered(tmp_path, out)) == 2
    assert capsys.readouterr().err == (
        f"agentflow: {tmp_path} is not a folder made by agentflow data generate: it has no "
        "readable plan.json of that kind\n"
    )
    assert main(filtered(out, tmp_path / "b")) == 2
    assert "is not a folder made by agentflow data generate" in capsys.readouterr().err
    (answers / "answers.jsonl").write_text('{"half":\n{}\n')
    assert main(filtered(answers, tmp_path / "c")) == 2
    assert capsys.readouterr().err.endswith("answers.jsonl is damaged in line 1\n")
    (answers / "answers.jsonl").write_text("")
    assert main(filtered(answers, tmp_path / "c")) == 2
    assert capsys.readouterr().err == (
        f"agentflow: {answers} holds no answers; record some with agentflow data generate\n"
    )


@pytest.mark.slow
def test_a_log_of_other_machines_is_refused(
    objectives: Path, tmp_path: Path, capsys: Captured
) -> None:
    answers, out = tmp_path / "a", tmp_path / "set"
    assert main(generate(objectives, answers, "--samples", "1")) == 0
    assert main(filtered(answers, out)) == 0
    capsys.readouterr()
    for file, command in (
        (out / "judged.jsonl", filtered(answers, out)),
        (answers / "answers.jsonl", generate(objectives, answers, "--samples", "1")),
    ):
        lines = file.read_text().splitlines(keepends=True)
        file.write_text("".join([lines[0], *lines]))
        assert main(command) == 2
        assert capsys.readouterr().err == (
            f"agentflow: {file} is damaged in line 2: the plan has another one there\n"
        )


@pytest.mark.slow
def test_a_killed_filter_makes_the_same_set(objectives: Path, tmp_path: Path) -> None:
    answers = tmp_path / "a"
    assert main(generate(objectives, answers, "--samples", "5", "--variants", "1")) == 0
    assert main(filtered(answers, tmp_path / "whole")) == 0
    killed = tmp_path / "killed"
    command = filtered(answers, killed)
    kill_until_done(command, killed / "judged.jsonl", Random(1), lines=8, kills=3)
    names = sorted(path.name for path in killed.iterdir())
    assert names == sorted(path.name for path in (tmp_path / "whole").iterdir())
    for name in names:
        assert (killed / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()

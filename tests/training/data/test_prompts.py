"""Prompts for verl: its columns, a parquet file that datasets reads, and a set that it reads."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import agentflow
from agentflow.cli import main
from agentflow.errors import UsageError
from agentflow.extras import install
from agentflow.training.data.exchange import prompt_rows
from agentflow.training.data.pairs import Pair, make_messages, make_prompt, make_reply, write_pairs
from tests.training.data.test_pairs import MACHINE, PROMPT
from tests.training.libraries import INSTALLED

Captured = pytest.CaptureFixture[str]


def test_tasks_take_turns_and_seeds_differ() -> None:
    rows = prompt_rows(["throwing", "movement/3"], 3, "auto")
    assert [row["reward_model"]["ground_truth"] for row in rows] == [
        "throwing",
        "movement/3",
        "throwing",
    ]
    assert [row["extra_info"]["seed"] for row in rows] == [0, 1, 2]
    assert rows[1]["prompt"] == agentflow.design_prompt("movement/3")
    with pytest.raises(UsageError, match="name at least one task"):
        prompt_rows([], 3, "auto")


@pytest.mark.training
def test_the_parquet_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    import datasets

    out = tmp_path / "prompts.parquet"
    command = ["data", "prompts", "--tasks", "throwing, movement", "--count", "4"]
    assert main([*command, "--out", str(out)]) == 0
    cache = str(tmp_path / "cache")
    rows = datasets.load_dataset("parquet", data_files=str(out), cache_dir=cache)["train"]
    assert rows.to_list() == prompt_rows(["throwing", "movement"], 4, "auto")


@pytest.mark.skipif(INSTALLED, reason="datasets is installed")
def test_without_the_library_the_extra_is_named(tmp_path: Path, capsys: Captured) -> None:
    assert main(["data", "prompts", "--out", str(tmp_path / "p.parquet")]) == 2
    assert capsys.readouterr().err == (
        f"agentflow: datasets is not installed; install it with: {install('train')}\n"
    )


def test_what_is_asked_for_is_checked_before_the_library(tmp_path: Path, capsys: Captured) -> None:
    assert main(["data", "prompts", "--tasks", "", "--out", str(tmp_path / "p.parquet")]) == 2
    assert "name at least one task" in capsys.readouterr().err


@pytest.mark.training
def test_datasets_reads_a_set_as_it_is(tmp_path: Path) -> None:
    import datasets

    prompt = make_prompt([PROMPT[0], {"role": "user", "content": "long " * 4000}])
    plain, braced = MACHINE.to_json()[:2], MACHINE.to_json()
    machines = [plain] * 700 + [braced]  # the last one in a later piece of the file
    pairs = [
        Pair(
            messages=make_messages(prompt, make_reply("Why.", MACHINE)),
            machine=tuple(machine),
            objective="tower",
            rationale="Why.",
            score=1.5,
            source="a model",
        )
        for machine in machines
    ]
    write_pairs(tmp_path / "train.jsonl", pairs)
    write_pairs(tmp_path / "dev.jsonl", pairs[:1])
    files = {name: str(tmp_path / f"{name}.jsonl") for name in ("train", "dev")}
    found = datasets.load_dataset("json", data_files=files, cache_dir=str(tmp_path / "cache"))
    assert (found["train"].num_rows, found["dev"].num_rows) == (701, 1)
    last = found["train"][700]
    assert last["messages"] == json.loads(pairs[700].model_dump_json())["messages"]
    assert agentflow.check(last["machine"]).machine == MACHINE

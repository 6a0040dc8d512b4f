"""`agentflow bench`: one run designed by many commands, each in a process of its own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from agentflow.app.sessions.shell import KEPT, call, read_arguments
from agentflow.cli import main
from agentflow.cli.commands.agents import TOOLS
from agentflow.errors import RunError, UsageError
from agentflow.runs import read_events, read_result, state_of
from agentflow.runs.writing import RunDirectory
from agentflow.tools.bench import TOOLS as OFFERED

CAR = str(Path(__file__).parents[2] / "examples" / "car.json")
QUERY = '[{"id": 0, "duration": [0, 1], "properties": ["position"]}]'


def test_every_tool_has_a_command_that_names_its_arguments() -> None:
    assert set(TOOLS) == {tool.spec.name for tool in OFFERED}
    for tool in OFFERED:
        for name in tool.spec.parameters["properties"]:
            assert name in TOOLS[tool.spec.name]["help"]


def test_arguments_are_text_or_json_as_the_tool_takes_them(tmp_path: Path) -> None:
    script = tmp_path / "edits.txt"
    script.write_text("Remove 6\nRemove 5\n")
    for tool, words, wanted in (
        ("simulate", ["12345678", "trial=2"], {"machine": "12345678", "trial": 2}),
        ("simulate", ['["a", "b"]'], {"machine": ["a", "b"]}),
        ("edit", ["a", f"@{script}"], {"machine": "a", "script": "Remove 6\nRemove 5\n"}),
        ("check", ["[]", "note=x=1"], {"machine": "[]", "note": "x=1"}),
        ("look", ["a", "follow=boulder"], {"machine": "a", "follow": "boulder"}),
        ("query", ["interval=0.5", "a", QUERY], {"interval": 0.5, "machine": "a"}),
    ):
        assert wanted.items() <= read_arguments(tool, words).items()


@pytest.mark.parametrize(
    ("tool", "words", "problem"),
    [
        ("history", ["a"], "history takes no arguments; 'a' is none of these"),
        ("verify", ["a", "b"], "verify takes machine; 'b' is none of these"),
        ("check", ["@missing.json"], "cannot read missing.json"),
    ],
)
def test_words_that_fit_nowhere_are_refused(tool: str, words: list[str], problem: str) -> None:
    with pytest.raises(UsageError, match=problem):
        read_arguments(tool, words)


def has_no_space(*_: object) -> None:
    raise RunError("no space")


@pytest.mark.slow
def test_a_car_by_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)

    def bench(*words: str, status: int = 0) -> Any:
        assert main(["bench", *words, "--json"]) == status
        return json.loads(capsys.readouterr().out)

    def refusal(*words: str) -> str:
        assert main(["bench", *words]) == 2
        return capsys.readouterr().err

    assert "runs has no unfinished run; begin one with: agentflow bench start" in refusal("history")
    run = Path(bench("start", "--task", "movement", "--rollouts", "12")["run"])
    name = bench("check", f"@{CAR}")["machine"]
    score = bench("simulate", name)["score"]
    (answer,) = bench("query", name, QUERY, "interval=0.25")["answers"]
    assert answer["times"] == pytest.approx([0, 0.25, 0.5, 0.75, 1], abs=0.01)
    assert Path(bench("look", name, "time=1")["picture"]).read_bytes().startswith(b"\x89PNG")
    refused = bench("edit", name, "Remove 99", status=1)
    assert "unchanged" in refused["refused"]
    changed = bench("edit", name, "Remove 6")["machine"]
    assert len(bench("history")["machines"]) == 2
    directory = RunDirectory.resume(run)
    assert "is in use" in refusal("simulate", changed)
    directory.close()
    assert (run / KEPT).exists()
    with monkeypatch.context() as full:
        full.setattr(RunDirectory, "save_machine", has_no_space)
        assert refusal("check", f"@{CAR}").endswith(": no space; then give this command again\n")
    end = bench("submit", name)
    assert "The design is finished, with a verified score of" in end["end"]
    assert read_result(run).score == score > 40
    assert (state_of(run), (run / KEPT).exists()) == ("done", False)
    tools = [event.data["tool"] for event in read_events(run) if event.kind == "tool"]
    assert tools == [
        "brief", "check", "simulate", "query", "look", "edit", "edit", "history", "submit"
    ]  # fmt: skip
    assert main(["replay", str(run)]) == 0
    assert "The design is finished" in refusal("history", "--run", str(run))
    assert main(["bench", "start", "--task", "movement", "--name", "a"]) == 0
    assert capsys.readouterr().err == "agentflow: this run is runs/a\n"
    first = "runs/a"
    bench("start", "--task", "movement", "--name", "b")
    assert "name one with --run: runs/a, runs/b" in refusal("history")
    assert bench("history", "--run", first)["run"] == first
    with pytest.raises(UsageError, match="was not begun with `agentflow bench start`"):
        call(Path(__file__).parents[2] / "runs" / "recorded-throwing", "brief", {}, print)

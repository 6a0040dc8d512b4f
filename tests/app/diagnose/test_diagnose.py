"""Diagnoses from question to numbers: scripted models, real simulations, interrupted runs."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from agentflow.app.diagnose.question import DOCUMENT, Diagnosis
from agentflow.app.diagnose.run import diagnose
from agentflow.errors import ConfigError, RunError, UnauthorisedError, UsageError
from agentflow.llm.messages import Reply, Request
from agentflow.machine import place, read_machine
from agentflow.machine.blocks.library import library
from agentflow.models.completion import complete_config
from tests.scripted import ScriptedClient

Answer = Callable[[Request], str]
PAIRS = 6


def machine_in(request: Request) -> Any:
    text = request.messages[1].text.partition("## Machine")[2].partition("## Question")[0]
    machine = read_machine(text, tuple(library())).machine
    assert machine is not None
    return machine


def knows_overlaps(request: Request) -> str:
    return f"```json\n{json.dumps(place(machine_in(request)).overlaps)}\n```"


def lists_every_pair(request: Request) -> str:
    count = len(machine_in(request))
    return json.dumps([[a, b] for b in range(count) for a in range(b)])


def says_nothing(_: Request) -> str:
    return ""


def is_hostile(_: Request) -> str:
    return '<script>alert(1)</script>\x1b[2J {"pairs": [[' + "[" * 3_000


def knows_poses(request: Request) -> str:
    geometry = place(machine_in(request))
    return json.dumps(
        [
            {"id": block.id, "facing": block.facing, "centre": block.center}
            for block in geometry.blocks
        ]
    )


def run(name: str, answer: Answer, out: Path, size: int, **model: Any) -> Diagnosis:
    config = complete_config({"seed": 3, "workers": 1, "model": model})
    return diagnose(name, config, size, out, client=ScriptedClient(answer))


def results(found: Diagnosis) -> dict[str, Any]:
    assert found.results is not None
    return dict(found.results)


def test_who_knows_all_overlaps_is_right(tmp_path: Path) -> None:
    found = results(run("overlap", knows_overlaps, tmp_path, PAIRS))
    assert (found["accuracy"], found["precision"], found["f1"]) == (1, 1, 1)
    assert (found["pairs"], found["found"], found["named"]) == (PAIRS, PAIRS, PAIRS)
    assert found["unreadable"] == 0


def test_who_lists_every_pair_is_accurate_but_not_precise(tmp_path: Path) -> None:
    done = run("overlap", lists_every_pair, tmp_path, PAIRS)
    found = results(done)
    every = sum(len(mark.machine) * (len(mark.machine) - 1) // 2 for mark in done.answers)
    assert (found["accuracy"], found["named"]) == (1, every)
    assert found["precision"] == pytest.approx(PAIRS / every)
    assert found["f1"] == pytest.approx(2 * PAIRS / (PAIRS + every))
    assert found["f1"] < 0.2


@pytest.mark.parametrize("answer", [says_nothing, is_hostile])
def test_who_says_nothing_finds_nothing(answer: Answer, tmp_path: Path) -> None:
    found = results(run("overlap", answer, tmp_path, PAIRS))
    assert (found["accuracy"], found["precision"], found["f1"]) == (0, None, 0)
    assert found["unreadable"] == found["questions"] > 1


def test_poses(tmp_path: Path) -> None:
    found = results(run("facing", knows_poses, tmp_path / "all", 3))
    assert found["blocks"] == 12
    assert (found["facing"]["share"], found["centre"]["share"]) == (1, 1)
    found = results(run("facing", is_hostile, tmp_path / "none", 3))
    assert (found["facing"]["count"], found["centre"]["count"], found["unreadable"]) == (0, 0, 3)


def test_rounded_centres_are_right_and_others_not(tmp_path: Path) -> None:
    def moved(by: float) -> Answer:
        def answer(request: Request) -> str:
            items = json.loads(knows_poses(request))
            for item in items:
                item["centre"][1] += by
            return json.dumps(items)

        return answer

    near = results(run("facing", moved(0.1), tmp_path / "near", 2))
    far = results(run("facing", moved(0.15), tmp_path / "far", 2))
    assert (near["centre"]["share"], far["centre"]["share"]) == (1, 0)
    assert far["facing"]["share"] == 1


@pytest.mark.slow
def test_outcomes_are_judged_by_simulation_and_half_of_them_are_yes(tmp_path: Path) -> None:
    out = tmp_path / "outcome"
    found = run("outcome", lambda _: '{"stand": true, "drive": true, "throw": true}', out, 6)
    judged = results(found)
    assert judged["faults"] == judged["unreadable"] == 0
    for verb, of in (("stand", 2), ("drive", 2), ("throw", 2), ("all", 6)):
        assert judged[verb]["right"] == judged[verb]["yes"]
        assert (judged[verb]["right"]["count"], judged[verb]["right"]["of"]) == (of // 2, of)
        assert judged[verb]["said_yes"]["share"] == 1

    def knows(request: Request) -> str:
        number = int(request.label.partition("/")[2])
        return json.dumps(found.answers[number].truth)

    told = results(run("outcome", knows, tmp_path / "told", 6))
    assert [told[verb]["right"]["share"] for verb in ("stand", "drive", "throw", "all")] == [1] * 4


@pytest.mark.slow
def test_a_diagnosis_is_continued_without_asking_again(tmp_path: Path) -> None:
    whole, part = tmp_path / "whole", tmp_path / "part"
    expected = run("overlap", knows_overlaps, whole, PAIRS)

    def fails_at_second(request: Request) -> str:
        if request.label == "overlap/1":
            raise UnauthorisedError("the key was refused")
        return knows_overlaps(request)

    with pytest.raises(UnauthorisedError, match=r"run the same command again to continue$"):
        run("overlap", fails_at_second, part, PAIRS)
    assert DOCUMENT.read(part).results is None
    client = ScriptedClient(knows_overlaps)
    config = complete_config({"seed": 3, "workers": 1})
    assert diagnose("overlap", config, PAIRS, part, client=client) == expected
    assert [request.label for request in client.requests] == ["overlap/1"]
    assert diagnose("overlap", config, PAIRS, part, client=ScriptedClient([])) == expected
    assert (part / "diagnosis.json").read_bytes() == (whole / "diagnosis.json").read_bytes()


def test_a_spent_budget_keeps_what_is_answered(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"^call limit reached \(1\): raise the limit in model"):
        run("overlap", knows_overlaps, tmp_path, PAIRS, budget={"calls": 1})
    assert len((tmp_path / "calls.jsonl").read_text().splitlines()) == 1
    assert results(run("overlap", knows_overlaps, tmp_path, PAIRS))["accuracy"] == 1


def test_another_diagnosis_in_the_folder_is_refused(tmp_path: Path) -> None:
    run("overlap", knows_overlaps, tmp_path, 2)
    with pytest.raises(RunError, match="holds a diagnosis with another size: 2, not 3; give the"):
        run("overlap", knows_overlaps, tmp_path, 3)
    (tmp_path / "diagnosis.json").write_text('{"format": 1')
    with pytest.raises(RunError, match=r"diagnosis.json is damaged: the file "):
        run("overlap", knows_overlaps, tmp_path, 2)


def test_a_folder_with_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("")
    with pytest.raises(RunError, match=r"is not a diagnosis: it has thesis.tex and no diagnosis"):
        run("overlap", knows_overlaps, tmp_path, 2)


def test_an_incomplete_reply_counts_as_far_as_it_goes(tmp_path: Path) -> None:
    client = ScriptedClient(lambda request: Reply(text=knows_overlaps(request), finish="length"))
    found = diagnose("overlap", complete_config({}), 2, tmp_path, client=client)
    assert results(found)["accuracy"] == 1


def test_settings_that_decide_nothing_are_refused(tmp_path: Path) -> None:
    config = complete_config({"workflow": "single"})
    with pytest.raises(UsageError, match=r"^a diagnosis has no workflow: it asks questions about"):
        diagnose("overlap", config, 2, tmp_path, client=ScriptedClient([]))

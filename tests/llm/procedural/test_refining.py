"""Refinements: valid, in both formats, and never a change that failed before."""

from __future__ import annotations

import pytest

from agentflow.agents.history import EditRecord, History
from agentflow.agents.refiner import RefinerInput
from agentflow.machine.tree import Machine
from tests.llm.procedural.asking import blueprint_of, brief_of, designs, refinement
from tests.llm.procedural.test_inspecting import machine_of

BROKEN = "Score: 0.00 m\nBroken: block 2 (Log) off block 1 at 0.30 s, load 1.20"
TIPPED = (
    "Score: 0.00 m\nOrientation of block 0: facing y+ with its top towards z- from 0.0 to 5.0 s"
)


async def machine_for(task: str, seed: int) -> Machine:
    brief = brief_of(task)
    machine = await designs(brief, await blueprint_of(brief, seed), seed, "t")
    assert machine is not None
    return machine


@pytest.mark.parametrize("task", ["throwing", "movement"])
@pytest.mark.parametrize("form", ["steps", "whole_machine"])
async def test_refinements_are_valid_and_diverse(task: str, form: str) -> None:
    machine = await machine_for(task, 1)
    scripts = set()
    for number in range(10):
        given = RefinerInput(
            brief_of(task), machine, feedback=(BROKEN, TIPPED)[number % 2], score=0.0, format=form
        )
        attempt = await refinement(given, 1, f"refiner/{number}")
        assert attempt.parsed.output is not None, attempt.parsed.problem
        scripts.add(attempt.reply.text)
    assert len(scripts) >= 5


@pytest.mark.slow
async def test_a_machine_that_tips_often_gets_a_wider_base() -> None:
    machine = await machine_for("throwing", 1)
    names = []
    for number in range(40):
        given = RefinerInput(brief_of("throwing"), machine, feedback=TIPPED, score=0.0)
        names.append((await refinement(given, 0, f"r/{number}")).reply.text)
    assert sum("widen or weigh down the base" in text for text in names) >= 6


async def test_it_fixes_the_failed_step_and_avoids_what_did_not_help() -> None:
    """Every attempted step is refused; none is repeated."""
    machine = machine_of((2, 0, 2), (2, 0, 3))
    tried = set[str]()
    for number in range(6):
        earlier = tuple(f"{line}: Error (overlap: in the way)" for line in sorted(tried))
        given = RefinerInput(brief_of("movement"), machine, earlier=earlier)
        text = (await refinement(given, 0, f"r/{number}")).reply.text
        steps = text.partition("<Modification Steps>\n")[2].partition("\n</")[0].splitlines()
        assert not tried.intersection(steps)
        tried.update(steps)


async def test_the_history_is_not_repeated() -> None:
    machine = machine_of((2, 0, 2), (2, 0, 3))
    first = (await refinement(RefinerInput(brief_of("movement"), machine), 0)).reply.text
    script = first.partition("<Modification Steps>\n")[2].partition("\n</")[0]
    history = History().add(EditRecord(script, "Success", before=5.0, after=4.0))
    for number in range(8):
        given = RefinerInput(brief_of("movement"), machine, history=history)
        text = (await refinement(given, 0, f"r/{number}")).reply.text
        assert f"<Modification Steps>\n{script}\n<" not in text


async def test_it_adopts_what_trials_have_shown() -> None:
    """Edits that raised the score, the best most often; none that lowered it or failed before."""
    machine = machine_of((2, 0, 2), (2, 0, 3))
    trials = (
        "Trials of single edits around this machine, each alone, and how they change its score "
        "1.00:\n- Add 1 to 0 in 4; Add 1 to 1 in 99: +3.00\n"
        "- Add 1 to 0 in 4: +2.00, nothing breaks\n"
        "- a new 1 (Wooden Block) between block 0 and block 2: +1.00\n"
        "- Add 1 to 0 in 5: -1.00\n- 2 others: +0.00"
    )
    scripts = []
    for number in range(40):
        given = RefinerInput(brief_of("movement"), machine, score=1.0, trials=trials)
        text = (await refinement(given, 0, f"r/{number}")).reply.text
        scripts.append(text.partition("<Modification Steps>\n")[2].partition("\n</")[0])
    adopted = [script for script in scripts if "what trials showed" in script or "in 4" in script]
    assert sum(script.startswith("Add 1 to 0 in 4") for script in adopted) > 10
    assert any(script not in adopted for script in scripts)
    assert not any("new" in script for script in scripts)

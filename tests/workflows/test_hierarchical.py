import random
import re

import pytest

from agentflow.llm.messages import Reply, Request
from agentflow.machine.tree import Machine
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.settings import WorkflowSettings
from tests.workflows.fakes import (
    BLUEPRINT,
    CRITIQUE,
    INQUIRY,
    NOTHING,
    Author,
    Run,
    Script,
    Shelf,
    edit,
    fenced,
    machine,
    machine_in,
    steps,
)

SMALL = {"trajectories": 3, "search": {"rounds": 1, "width": 1, "request_rounds": 2}}
GOLDEN = {
    "meta_designer/attempt-1": NOTHING,
    "meta_designer/attempt-2": fenced(BLUEPRINT),
    "designer/structure-1/traj-1/candidate-1/attempt-1": fenced(steps((1, 0, 0))),
    "designer/structure-1/traj-2/candidate-1/attempt-1": NOTHING,
    "designer/structure-1/traj-2/candidate-1/attempt-2": fenced(steps((1, 0, 1))),
    "designer/structure-1/traj-3/candidate-1/attempt-1": NOTHING,
    "designer/structure-1/traj-3/candidate-1/attempt-2": fenced(steps((1, 0, 0), (1, 0, 0))),
    "designer/structure-2/traj-1/candidate-1/attempt-1": fenced(steps((1, 0, 0), (2, 0, 2))),
    "designer/structure-2/traj-2/candidate-1/attempt-1": fenced(steps((1, 0, 0), (2, 0, 2))),
    "designer/structure-2/traj-2/candidate-1/attempt-2": NOTHING,
    "designer/structure-2/traj-3/candidate-1/attempt-1": fenced(steps((1, 0, 1), (2, 0, 3))),
    "inspector/traj-1/attempt-1": CRITIQUE,
    "inspector/traj-3/attempt-1": NOTHING,
    "inspector/traj-3/attempt-2": NOTHING,
    "refiner/blind/traj-1/attempt-1": edit("Add 1 to 0 in 0"),
    "refiner/blind/traj-1/attempt-2": edit("Add 1 to 0 in 1"),
    "refiner/blind/traj-3/attempt-1": NOTHING,
    "refiner/blind/traj-3/attempt-2": edit("Remove 2"),
    "querier/traj-1/node-0/attempt-1": INQUIRY,
    "refiner/feedback/traj-1/round-1/node-0/try-1/attempt-1": edit("Add 1 to 0 in 0"),
    "refiner/feedback/traj-1/round-1/node-0/try-2/attempt-1": edit("Add 1 to 0 in 4"),
}
"""Three trajectories, two attempts per question; what each reply leads to, the test tells."""


def length(found: Machine) -> float:
    """Ten per block, and the face of the wheel."""
    return 10.0 * len(found) + next(step.face_id for step in found if step.type == 2)


async def golden() -> Run:
    run = Run(Script(GOLDEN), SMALL, shelf=Shelf(length), max_retry=2, seed=3)
    run.result = await run()  # type: ignore[attr-defined]
    return run


async def test_golden_run() -> None:
    """Plan at the second attempt: Body, Drive.

    Body   1: block in front. 2: block behind, at the second attempt. 3: no machine, then two
           blocks on one face: dropped.
    Refill the seed's stream draws trajectory 2 for the third place: 1, 2, 2.
    Drive  1: wheel left, at once. 2: alters the given block, then no machine: dropped.
           3 (on the copy of 2): wheel right, at once, although its body was no first attempt.
    Initial 1: 3 blocks, wheel at 2: 32. 3: 3 blocks, wheel at 3: 33. Mean 32.5, over all 65 / 3.
    Blind  1: face occupied, then a block behind: 42. 3: no sections, then the only wheel removed.
           It ends here, although its first machine is still the best but one.
    Loop   1: the querier asks once; try 1 is refused, try 2 adds a block on top: 52, the result.
    """
    assert random.Random("3/beam").choice([0, 1]) == 1
    run = await golden()
    result = run.result  # type: ignore[attr-defined]
    assert sorted(run.labels) == sorted(GOLDEN)
    assert result.best is not None
    assert result.best.machine == machine((1, 0, 0), (2, 0, 2), (1, 0, 1), (1, 0, 4))
    assert (result.best.score, result.best.trajectory) == (52.0, 1)
    assert (result.best_stage, result.stopped, result.reason) == ("env_feedback", None, "")
    rows = run.notes.of("stage")
    assert rows["initial"] == {
        "name": "initial",
        "trajectories": 3,
        "parsed_first": 1,
        "spatial_first": 1,
        "valid_first": 1,
        "valid": 2,
        "mean": 32.5,
        "mean_all": 65 / 3,
        "max": 33.0,
        "std": 0.5,
        "calls": 11,
        "tokens": 1210,
        "rollouts": 2,
        "expansions": 0,
        "attempts": 0,
        "children": 0,
    }
    told = ("valid_first", "valid", "mean", "mean_all", "max", "std", "calls", "rollouts")
    assert [rows["blind_refinement"][key] for key in told] == [0, 1, 42.0, 14.0, 42.0, 0.0, 7, 1]
    assert [rows["env_feedback"][key] for key in told] == [0, 1, 52.0, 52 / 3, 52.0, 0.0, 3, 1]
    assert [rows["env_feedback"][key] for key in ("expansions", "attempts", "children")] == [
        *(1, 2, 1)
    ]


async def test_golden_record() -> None:
    run = await golden()
    notes = run.notes
    assert notes.of("refill") == {"structure-2": {"sources": [1, 2, 2]}}
    candidates = notes.of("candidate")
    assert [label for label, data in candidates.items() if data["valid"]] == [
        "initial/traj-1",
        "initial/traj-3",
        "blind_refinement/traj-1",
        "env_feedback/traj-1",
    ]
    assert candidates["blind_refinement/traj-2"]["reason"] == "ended in an earlier stage"
    assert candidates["blind_refinement/traj-3"]["reason"] == (
        "The machine is not valid:\n"
        "- the task requires exactly 1 block of type 2 (Powered Wheel); there are 0"
    )
    assert set(notes.of("evaluation")) == {
        "initial/traj-1",
        "initial/traj-3",
        "blind_refinement/traj-1",
        "env_feedback/traj-1/round-1/node-1",
    }
    assert notes.of("search") == {
        "env_feedback/traj-1": {
            "result": 1,
            "best": 1,
            "stopped": False,
            "expansions": 1,
            "attempts": 2,
            "valid": 1,
            "rollouts": 1,
        }
    }
    assert notes.of("node")["env_feedback/traj-1/node-1"]["made_by"] == "round-1/node-0/try-2"
    assert set(notes.of("attempt")) == set(GOLDEN)
    assert notes.of("inspection")["inspector/traj-1"]["defects"] == [
        {"blocks": [1], "structure": "Body", "text": "too small", "severity": ""}
    ]
    assert set(notes.machines) >= set(run.shelf.tried)


async def test_the_inspector_sees_which_blocks_are_of_which_structure() -> None:
    prompt = (await golden()).prompt("inspector/traj-1/attempt-1")
    assert prompt.partition("## Structures\n")[2].partition("\n\n")[0].splitlines() == [
        "Body: blocks 0, 1",
        "Drive: blocks 2",
    ]


async def test_only_the_first_refiner_sees_the_critique() -> None:
    run = await golden()
    blind = run.prompt("refiner/blind/traj-1/attempt-1")
    assert "It looks lame." in blind
    assert "## Simulation feedback" not in blind
    loop = run.prompt("refiner/feedback/traj-1/round-1/node-0/try-1/attempt-1")
    assert "It looks lame." not in loop
    assert "Rolled 42.0 m." in loop
    assert "1 tables." in loop
    assert "32.00 -> 42.00" in loop
    assert "Add 1 to 0 in 1" in loop
    assert "## Earlier attempts" not in loop
    second = run.prompt("refiner/feedback/traj-1/round-1/node-0/try-2/attempt-1")
    assert "## Earlier attempts" in second
    assert "Add 1 to 0 in 0" in second
    assert "1 tables." in second


@pytest.mark.parametrize(
    ("switch", "value", "gone"),
    [
        ("inspector", False, "It looks lame."),
        ("querier", False, "1 tables."),
        ("feedback", "basic", "1 tables."),
        ("feedback", "score_only", "Rolled"),
        ("history", False, "## Edit history"),
        ("spatial", False, "support polygon"),
        ("meta_designer", "off", "## Blueprint"),
    ],
)
async def test_switches(switch: str, value: object, gone: str) -> None:
    """What a switch turns off is in no refiner's prompt, and is there with the switch on."""
    for setting, expected in (({}, True), ({switch: value}, False)):
        run = Run(Author(refused=0.0), {**SMALL, **setting})
        await run()
        refiners = [r for r in run.client.requests if r.role == "refiner"]
        assert any(gone in r.messages[1].text for r in refiners) == expected
    roles = {request.role for request in run.client.requests}
    assert ("inspector" in roles) == (switch != "inspector")
    assert ("querier" in roles) == (switch not in ("querier", "feedback"))
    assert ("meta_designer" in roles) == (switch != "meta_designer")


async def test_the_first_refinement_can_see_a_simulation() -> None:
    """Of the machine as designed, which costs no call and no rollout; as far as feedback goes."""
    blind = "refiner/blind/traj-1/attempt-1"
    seen, labels = [], []
    for setting in ({}, {"simulate_first": True}):
        run = Run(Author(refused=0.0), {**SMALL, **setting})
        await run()
        seen.append(run.prompt(blind))
        labels.append([request.label for request in run.client.requests])
    assert "## Simulation feedback" not in seen[0]
    assert re.search(r"## Simulation feedback\nScore: [\d.]+\nRolled ", seen[1])
    assert labels[0] == labels[1]
    run = Run(Author(refused=0.0), {**SMALL, "simulate_first": True, "feedback": "score_only"})
    await run()
    assert re.search(r"## Simulation feedback\nScore: [\d.]+\n\n", run.prompt(blind))


@pytest.mark.parametrize("vision", [True, False])
async def test_vision_shows_refiners_the_machine_they_refine(vision: bool) -> None:
    run = Run(Author(refused=0.0), {**SMALL, "vision": vision})
    await run()
    for request in run.client.requests:
        images = request.messages[1].images
        assert ("## Views" in request.messages[1].text) == bool(images)
        assert bool(images) == (vision and request.role == "refiner")
        if images:
            shown = machine_in(request.messages[1].text).digest
            assert images == (f"data:image/png;base64,{shown}",)


async def test_a_detailed_plan_sees_faces_and_is_told_step_by_step() -> None:
    for setting in ("structures", "detailed"):
        run = Run(Author(refused=0.0), {**SMALL, "meta_designer": setting})
        await run()
        system, user = (message.text for message in run.client.requests[0].messages)
        assert ("step by step" in system) == (setting == "detailed")
        assert ("Front 0 @" in user) == (setting == "detailed")
        assert ("# Geometry" in system) == (setting == "detailed")


@pytest.mark.parametrize("name", ["hierarchical", "single"])
async def test_designers_follow_the_rationale_of_another_run(name: str) -> None:
    """Two plans for three trajectories: the first, the second, the first again."""
    run = Run(Author(refused=0.0), {**SMALL, "rationales": ["long arm", "short arm"]})
    await run(name)
    for request in run.client.requests:
        prompt = request.messages[1].text
        number = int(re.search(r"traj-(\d)", request.label)[1]) if "traj" in request.label else 0
        plan = ("long arm", "short arm")[(number - 1) % 2]
        expected = f"## Rationale to follow\n> {plan}\n"
        assert (expected in prompt) == (request.role == "designer")


@pytest.mark.parametrize("refinement", ["steps", "whole_machine"])
@pytest.mark.parametrize("name", ["hierarchical", "iterative", "single"])
async def test_coordinates_all_the_way(name: str, refinement: str) -> None:
    """Machines are shown and sent as coordinates, and are the same as in the other notation."""
    shown = {**SMALL, "refinement": refinement}
    results = []
    for representation in ("tree", "coordinates"):
        run = Run(Author(seed=2, refused=0.0), {**shown, "representation": representation})
        result = await run(name)
        assert [stage.name for stage in result.stages][-1] == "env_feedback"
        for request in run.client.requests:
            system, user = (message.text for message in request.messages[:2])
            assert representation == "tree" or '"face_id"' not in system + user
        results.append(result.best and result.best.score)
    assert results[0] == results[1]


async def test_whole_machine_refinements() -> None:
    run = Run(Author(seed=1, refused=0.0), {**SMALL, "refinement": "whole_machine"})
    result = await run()
    assert [stage.name for stage in result.stages][-1] == "env_feedback"
    assert result.best is not None
    assert len(result.best.machine or ()) > 3
    told = run.prompt("refiner/feedback/traj-1/round-1/node-0/try-1/attempt-1")
    assert re.search(r"## Edit history\n> 1\. Success, score .*\n>    a new machine: d\n", told)


async def test_candidates_fill_empty_places() -> None:
    """Two designs per place: the first has none, the second two; both places are then taken."""
    body = "designer/structure-1/traj-{}/candidate-{}/attempt-1"
    replies = {
        "meta_designer/attempt-1": fenced(BLUEPRINT),
        body.format(1, 1): NOTHING,
        body.format(1, 2): NOTHING,
        body.format(2, 1): fenced(steps((1, 0, 0))),
        body.format(2, 2): fenced(steps((1, 0, 1))),
        **{
            f"designer/structure-2/traj-{t}/candidate-{c}/attempt-1": fenced(
                steps((1, 0, 2 - t), (2, 0, c + 1))
            )
            for t in (1, 2)
            for c in (1, 2)
        },
    }
    settings = {"trajectories": 2, "candidates": 2, "inspector": False, "search": {"rounds": 0}}
    run = Run(
        Script({**replies, **{f"refiner/blind/traj-{t}/attempt-1": NOTHING for t in (1, 2)}}),
        settings,
        max_retry=1,
    )
    result = await run()
    assert run.notes.of("refill") == {"structure-2": {"sources": [1, 2]}}
    assert [c.machine for c in result.stages[0].candidates] == [
        machine((1, 0, 1), (2, 0, 2)),
        machine((1, 0, 0), (2, 0, 2)),
    ]
    assert [c.first.valid for c in result.stages[0].candidates] == [False, True]
    assert [stage.name for stage in result.stages] == ["initial", "blind_refinement"]
    assert result.stages[1].survivors == ()


async def test_no_blueprint_is_a_result() -> None:
    run = Run(Author(refused=1.0), SMALL)
    result = await run()
    assert (result.best, result.stopped) == (None, None)
    assert result.reason.startswith("no valid machine: no valid blueprint: ")
    assert run.labels == [f"meta_designer/attempt-{i}" for i in (1, 2, 3)]
    assert [len(stage.candidates) for stage in result.stages] == [3]


async def test_a_structure_without_designs_ends_the_construction() -> None:
    """The bodies stay, one per trajectory and no copies, recorded as invalid with the reason."""

    def replies(request):  # type: ignore[no-untyped-def]
        if "Name: Drive" in request.messages[1].text:
            return NOTHING
        return Author(refused=0.0)(request)

    run = Run(replies, SMALL, max_retry=2)
    result = await run()
    assert result.best is None
    (stage,) = result.stages
    assert all(c.machine is not None and len(c.machine) == 2 for c in stage.candidates)
    assert all(
        c.reason.startswith("no valid design for structure 'Drive': ") for c in stage.candidates
    )
    assert set(run.notes.of("construction_end")) == {"structure-2"}
    assert run.shelf.tried == []


async def test_unscored_machines_are_never_best() -> None:
    run = Run(Author(refused=0.0), SMALL, shelf=Shelf(lambda _: None))
    result = await run()
    assert result.best is None
    assert result.reason == ("valid machines, but none could be scored: every simulation failed")
    assert run.notes.of("stage")["initial"]["mean_all"] is None


async def test_a_search_over_the_whole_run_plans_anew_for_more_trajectories() -> None:
    """One of four follows a plan, which three in a row share; one that is not valid is replaced by
    the first one. One designer makes each of the other machines."""
    author = Author(refused=0.0)

    def answer(request: Request) -> Reply:
        return Reply(text=NOTHING) if "traj-7" in request.label else author(request)

    settings = {**SMALL, "max_simulations": 30, "search": {"strategy": "independent"}}
    run = Run(answer, settings, max_retry=2)
    result = await run()
    many = len(result.stages[0].candidates)
    plans = [label for label in run.labels if label.startswith("meta_designer")]
    planned = range(1, many + 1, 4)
    firsts = [number - (number - 1) % 3 for number in planned]
    assert [label.split("/")[1] for label in plans if label.endswith("attempt-1")] == [
        "attempt-1",
        *(f"traj-{first}" for first in firsts[1:]),
    ]
    built = {
        int(label.split("traj-")[1].split("/")[0]) for label in run.labels if "structure" in label
    }
    assert built == set(planned)
    invalid = {c.trajectory for c in result.stages[0].candidates if c.machine is None}
    assert invalid == {7}, "its designer gives no machine either; those of 9 do without its plan"


async def test_no_rounds_skip_a_search_over_the_whole_run() -> None:
    run = Run(Author(refused=0.0), {**SMALL, "search": {"strategy": "halving", "rounds": 0}})
    result = await run()
    assert [stage.name for stage in result.stages] == ["initial", "blind_refinement"]


@pytest.mark.parametrize(("trajectories", "plans"), [(1, 6), (3, 6), (8, 3)])
def test_estimates_count_plans_that_some_first_machine_follows(
    trajectories: int, plans: int
) -> None:
    """Every fourth one follows a plan, however often the meta-designer may plan anew."""
    search = {"strategy": "independent"}
    settings = {"trajectories": trajectories, "max_simulations": 24, "search": search}
    hierarchical = WORKFLOWS["hierarchical"]
    assert hierarchical.calls(WorkflowSettings.model_validate(settings))["meta_designer"] == plans

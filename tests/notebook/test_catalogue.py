"""Tasks and blocks as objects."""

from __future__ import annotations

import pytest

import agentflow
from agentflow.app.tasks import list_tasks, task_json
from agentflow.errors import UsageError


def test_a_task_says_what_the_command_says() -> None:
    told, found = (
        task_json("throwing/3", ["wall.height=2"]),
        agentflow.task("throwing/3", wall_height=2),
    )
    assert (found.name, found.family) == ("throwing/3", "throwing")
    assert found.scene == told["scene"]
    assert found.schedule == told["schedule"]
    assert found.score == told["score"]
    assert [(k.name, k.value, k.range, k.help) for k in found.knobs] == [
        tuple(knob.values()) for knob in told["knobs"]
    ]
    assert found.required == {36: 1}
    assert (found.good, found.record) == (told["good"], told["record"])
    assert "scene" not in repr(found)
    assert len(repr(found)) < 400


def test_knobs_are_named_with_dots_or_underscores() -> None:
    dotted = agentflow.task("throwing", **{"wall.height": 3})
    assert dotted == agentflow.task("throwing", wall_height=3) != agentflow.task("throwing")
    with pytest.raises(UsageError, match="wall_heigth"):
        agentflow.task("throwing", wall_heigth=3)
    with pytest.raises(UsageError, match=r"wall.height of throwing must be 0 to 10 m, not 99"):
        agentflow.task("throwing", wall_height=99)
    with pytest.raises(UsageError, match="unknown task 'trowing'"):
        agentflow.task("trowing")


def test_a_task_with_given_blocks_has_them_as_a_machine() -> None:
    given = agentflow.task("gearing").given
    assert given is not None
    assert len(given) > 1
    assert agentflow.task("movement").given is None


@pytest.mark.slow
def test_every_task_is_listed() -> None:
    assert [found.name for found in agentflow.tasks()] == [each["name"] for each in list_tasks()]


def test_blocks_are_those_of_the_library() -> None:
    named = {block.name: block for block in agentflow.blocks()}
    assert named["Log"].type == 63
    assert named["Log"].faces[0].id == 0
    assert [block.type for block in agentflow.blocks()] == sorted(b.type for b in named.values())

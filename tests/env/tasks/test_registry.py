"""Contracts over every level, and how names and knobs are refused."""

from __future__ import annotations

import math
import pickle
from pathlib import Path

import pytest

from agentflow.env.tasks.knobs import knobs_of
from agentflow.env.tasks.registry import FAMILIES, get_level, get_task, knob_table, task_names
from agentflow.errors import ConfigError, UnknownNameError, UsageError
from tests.loops import for_each

NAMES = task_names()


@for_each(NAMES)
def test_every_level_tells_everything(name: str) -> None:
    task = get_task(name)
    brief = task.brief
    assert brief.name == task.name == name
    sentences = (brief.objective, *brief.scene, *brief.schedule, *brief.score)
    assert all(sentence and not sentence[0].islower() for sentence in sentences)
    assert all(sentence.endswith(".") for sentence in sentences)
    assert brief.blocks == tuple(sorted(set(brief.blocks)))
    assert set(brief.required) <= set(brief.blocks)
    assert f"{task.window:g} s" in " ".join((*brief.schedule, *brief.score))


@for_each(NAMES)
def test_every_scene_is_finite_named_and_repeatable(name: str) -> None:
    scene = get_task(name).scene()
    numbers = [n for t in scene.objects for n in (*t.size, *t.position, *t.rotation, t.mass)]
    assert all(math.isfinite(n) for n in (*numbers, *scene.wind))
    assert all(extent > 0 for item in scene.objects for extent in item.size)
    names = [item.name for item in scene.objects]
    assert len(set(names)) == len(names)
    assert "ground" not in names
    assert get_task(name).scene() == scene


@for_each(NAMES)
def test_every_level_says_what_a_good_score_is(name: str) -> None:
    level = get_level(name)
    assert level.file.good > 0
    assert level.file.title


@for_each(NAMES)
def test_every_task_travels_to_other_processes(name: str) -> None:
    task = get_task(name)
    assert pickle.loads(pickle.dumps(task)) == task


@for_each(NAMES)
def test_the_brief_follows_the_knobs(name: str) -> None:
    task = get_task(name, {"window": "12.5", "wind.speed": "4"})
    text = " ".join((*task.brief.scene, *task.brief.schedule, *task.brief.score))
    assert task.window == 12.5
    assert "12.5 s" in text
    assert "4 m/s towards z-" in text
    assert task.scene().wind[2] == -4.0


@for_each(NAMES)
def test_every_ranged_knob_refuses_what_lies_outside(name: str) -> None:
    for item, value in knob_table(get_task(name)):
        if item.low is None or item.high is None:
            continue
        assert item.low <= value <= item.high
        with pytest.raises(ConfigError) as caught:
            get_task(name, {item.name: item.high + 1})
        assert str(caught.value) == (
            f"{item.name} of {name} must be {item.range}, not {item.high + 1!r}"
        )


@for_each(FAMILIES)
def test_every_knob_has_a_line_of_help(name: str) -> None:
    assert all(item.help for item in knobs_of(FAMILIES[name].knobs))


def test_a_first_level_has_two_names() -> None:
    assert get_task("throwing/1") == get_task("throwing")


def test_the_schedule_tells_of_allowed_blocks_only() -> None:
    """A task without steering hinges does not mention them."""
    told = {name: "\n".join(get_task(name).brief.schedule) for name in ("movement", "lifting")}
    assert "wheels, rotating blocks and steering blocks start to turn" in told["lifting"]
    assert "steering hinges swing" in told["lifting"]
    assert "steering" not in told["movement"].replace("switched or steered", "")


def test_the_start_times_reach_the_schedule() -> None:
    task = get_task("movement", {"schedule.motors": 1.5})
    assert (task.schedule.motors, task.schedule.springs) == (1.5, 0.0)
    assert (
        "At t = 1.5 s wheels and rotating blocks start to turn and never stop."
        in task.brief.schedule
    )


def test_an_unknown_task_names_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="unknown task 'thowing'; known: throwing"):
        get_task("thowing")


def test_an_unknown_knob_names_the_nearest_with_their_ranges() -> None:
    with pytest.raises(ConfigError) as caught:
        get_task("movement", {"wind": 3})
    assert str(caught.value) == (
        "unknown knob 'wind' of movement; known: window (1 to 60 s), wind.down (-20 to 20 m/s), "
        "wind.speed (-20 to 20 m/s), wind.cross (-20 to 20 m/s), schedule.motors (0 to 60 s), "
        "schedule.springs (0 to 60 s), ..."
    )


@pytest.mark.parametrize("knob", ["wind", "wind.speed.more", "score"])
def test_a_knob_of_the_wrong_shape_is_refused(knob: str) -> None:
    with pytest.raises(ConfigError, match=r"of throwing"):
        get_task("throwing", {knob: "brisk"})


def test_knobs_may_be_nested_dotted_or_both() -> None:
    given = {"wall": {"height": 2}, "wall.thickness": 1, "wind.speed": 3}
    task = get_task("throwing", given)
    assert task.scene().objects[0].size == (1.0, 2.0, 23.0)
    assert given["wall"] == {"height": 2}


def test_an_own_level_is_a_file(tmp_path: Path) -> None:
    path = tmp_path / "storm.yaml"
    path.write_text("family: throwing\ntitle: storm\ngood: 5\nparameters: {wind: {speed: 12}}\n")
    task = get_task(str(path), {"wall.height": 2})
    assert task.name == str(path)
    assert task.scene().wind == (0.0, 0.0, -12.0)
    assert task.scene().objects[0].size[1] == 2.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("family: [", "is not YAML: "),
        ("title: x\ngood: 1\n", ": family: is missing"),
        ("title: x\ngood: 1\ngood: 2\n", "is not YAML: line 3: the key 'good' is duplicated"),
        ("titel: x\n", ": unknown key 'titel'; known: title, "),
        (
            "family: throwing\ntitle: x\ngood: 1\nparameters: {window: true}\n",
            "expected a number, not true or false",
        ),
        ("family: swimming\ntitle: x\ngood: 1\n", "unknown task family 'swimming'; known: "),
    ],
)
def test_a_damaged_level_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "level.yaml"
    path.write_text(text)
    with pytest.raises((ConfigError, UnknownNameError)) as caught:
        get_task(str(path))
    assert message in str(caught.value)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"cannot read the level .*: No such file"):
        get_task(str(tmp_path / "none.yaml"))


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"\xb0\xff", "the level {} is not UTF-8 text"),
        (b"just text", "{} must be a mapping with family, title, good and parameters"),
        (
            b"[\n" * 5000,
            "{} is not YAML: line 101: more than 100 groups and lists are inside each other",
        ),
        (b"family: gearng\ntitle: t\ngood: 1\n", "unknown task family 'gearng'; known: gearing, "),
    ],
)
def test_what_is_no_level_is_refused_in_one_line(
    tmp_path: Path, content: bytes, problem: str
) -> None:
    path = tmp_path / "own.yaml"
    path.write_bytes(content)
    with pytest.raises(UsageError) as caught:
        get_task(str(path))
    message = str(caught.value)
    assert message.startswith(problem.format(path))
    assert "\n" not in message


def test_types_that_a_level_withholds_are_in_no_brief() -> None:
    for family in FAMILIES:
        free = sorted(set(get_task(family).brief.blocks) - {0, *get_task(family).brief.required})
        without = get_task(family, {"blocks.without": free[-1:]}).brief.blocks
        assert set(get_task(family).brief.blocks) - set(without) == set(free[-1:])

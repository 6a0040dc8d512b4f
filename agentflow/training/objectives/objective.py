"""Design objectives: what a machine must do, where, with which blocks, and whether one does."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import BaseModel, Field, SerializeAsAny, ValidationError, field_validator

from agentflow.config.shipped import find_config
from agentflow.env.rollout import Broken, Feedback, Rollout, Trace, Verdict
from agentflow.env.scene import Scene
from agentflow.env.tasks.base import Referee, Task
from agentflow.env.tasks.registry import get_task
from agentflow.errors import ConfigError, NoScoreError, UnknownNameError, UsageError
from agentflow.files.faults import tell_fault
from agentflow.files.yaml import read_yaml_file
from agentflow.machine.brief import Brief
from agentflow.machine.tree import ROOT, Machine
from agentflow.training.objectives.functions import read_test
from agentflow.training.objectives.measuring import Finding, FunctionTest, Motion

ABOUT_TRIALS = " trials differ at random"
"""Part of the sentence about a level's random trials; an objective has one trial, as described."""


class LevelScene(BaseModel, frozen=True, extra="forbid"):
    """A level of a task family with changed knobs."""

    level: str
    knobs: dict[str, Any] = {}
    """Dotted, as in `--set`."""


class Objective(BaseModel, frozen=True, extra="forbid"):
    """One design objective."""

    name: str
    text: str
    """What to build, in one sentence."""
    kind: Literal["function", "constraint"]
    """Whether it says what a machine does, or adds constraints of the surroundings or demands."""
    blocks: tuple[int, ...] = Field(min_length=1)
    """Allowed block types, of those that the level allows."""
    scene: LevelScene
    test: Mapping[str, SerializeAsAny[FunctionTest]] = Field(min_length=1)
    """Function tests by their name in `FUNCTIONS`; a machine works if it passes all of them."""

    @field_validator("name")
    @classmethod
    def _check_name(cls, name: str) -> str:
        if not re.fullmatch(r"[a-z][a-z0-9-]*", name):
            raise ValueError(
                "must start with a lower-case letter, followed by lower-case letters, digits or '-'"
            )
        return name

    @field_validator("text")
    @classmethod
    def _check_text(cls, text: str) -> str:
        if not re.fullmatch(r"[A-Z].*\.", text):
            raise ValueError(
                "must be one line that starts with a capital letter and ends with a full stop"
            )
        return text

    @field_validator("test", mode="before")
    @classmethod
    def _read_tests(cls, tests: object) -> object:
        if not isinstance(tests, Mapping):
            return tests
        return {name: read_test(str(name), content) for name, content in tests.items()}

    @property
    def phrases(self) -> str:
        """The function tests in words, as one sentence."""
        return f"The machine works if {'; '.join(test.phrase() for test in self.test.values())}."

    @property
    def task(self) -> ObjectiveTask:
        """The task to simulate: the level, with the objective's text and blocks in its brief.

        Raises:
            ConfigError: The level or a knob does not exist, or the level does not allow a block
                or needs another one.
        """
        level, knobs = self.scene.level, self.scene.knobs
        brief = get_task(level, knobs).brief
        if wrong := [kind for kind in self.blocks if kind not in brief.blocks]:
            allowed = ", ".join(map(str, brief.blocks))
            raise ConfigError(
                f"blocks: the level {level} does not allow type {wrong[0]}; it allows {allowed}"
            )
        if missing := {ROOT.type, *brief.required}.difference(self.blocks):
            needed = min(missing)
            raise ConfigError(f"blocks: every machine for {level} needs type {needed}; add it")
        without = [kind for kind in brief.blocks if kind not in self.blocks]
        base = get_task(level, {**knobs, "blocks.without": without})
        return ObjectiveTask(
            self.name,
            base.level,
            base.parameters,
            base.window,
            base.schedule,
            base.engine,
            base=base,
            text=self.text,
            demands=self.phrases,
        )


@dataclass(frozen=True)
class ObjectiveTask(Task):
    """A level with another objective: one rollout, without random trials, scored as the level."""

    family: ClassVar[str] = "objective"
    base: Task = field(kw_only=True)
    """The level, with the objective's blocks."""
    text: str = field(kw_only=True)
    demands: str = field(kw_only=True)

    @property
    def brief(self) -> Brief:
        """The level's, with the objective's name and text, and its tests in place of the score."""
        brief = self.base.brief
        scene = tuple(sentence for sentence in brief.scene if ABOUT_TRIALS not in sentence)
        return replace(
            replace(brief, name=self.name, objective=self.text, scene=scene),
            score=(self.demands,),
            greatest=None,
        )

    def scene(self, machine: Machine | None = None) -> Scene:
        return self.base.scene(machine)

    def referee(self, machine: Machine) -> Referee:
        return self.base.referee(machine)

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        return self.base.feedback(machine, trace, broken, verdict)


@dataclass(frozen=True)
class ObjectiveVerdict:
    """Whether a machine works."""

    passed: bool
    found: Mapping[str, Finding]
    """Measured values and thresholds, such as "moves.metres"; empty if nothing was simulated."""


def works(objective: Objective, rollout: Rollout, machine: Machine) -> ObjectiveVerdict:
    """Apply the function tests to a rollout of `objective.task`.

    Args:
        objective: What the machine must do.
        rollout: Invalid machines and diverged rollouts do not pass.
        machine: The simulated machine.

    Raises:
        NoScoreError: The simulation timed out or crashed, which says nothing about the machine.
    """
    if rollout.status in ("timeout", "crashed"):
        raise NoScoreError(f"the simulation for {objective.name!r} ended as {rollout.status}")
    if rollout.status != "ok" or rollout.trace is None:
        return ObjectiveVerdict(False, {})
    motion = Motion(machine, rollout, rollout.trace, objective.task.window)
    found = {
        f"{name}.{key}": finding
        for name, test in objective.test.items()
        for key, finding in test.measure(motion)
    }
    return ObjectiveVerdict(all(finding.passed for finding in found.values()), found)


OBJECTIVES = Path("configs/objectives.yaml")
"""The objectives that come with the source code."""


def read_objectives(path: str | Path = OBJECTIVES) -> tuple[Objective, ...]:
    """Read objectives, in the order of the file.

    Raises:
        ConfigError: The file cannot be read, or an objective is wrong; the message names it, what
            is wrong, and what is possible.
    """
    objectives = tuple(_read(entry, path, i) for i, entry in enumerate(_entries(path), start=1))
    counts = Counter(objective.name for objective in objectives)
    if repeated := [name for name, count in counts.items() if count > 1]:
        raise ConfigError(f"{path}: the name {repeated[0]!r} is used twice; names must differ")
    return objectives


def _entries(path: str | Path) -> list[object]:
    document = read_yaml_file(find_config(Path(path)), "the objectives file ")
    if not isinstance(document, list) or not document:
        raise ConfigError(f"{path} must be a list of objectives")
    return document


def _read(entry: object, path: str | Path, number: int) -> Objective:
    name = entry.get("name") if isinstance(entry, dict) else None
    where = f"objective {name or number} of {path}"
    try:
        objective = Objective.model_validate(entry)
    except ValidationError as error:
        raise ConfigError(f"{where}: {tell_fault(error, 'the entry', Objective)}") from None
    try:
        _check(objective)
    except UsageError as error:
        raise ConfigError(f"{where}: {error}") from None
    return objective


def _check(objective: Objective) -> None:
    """Raise ConfigError if a function test measures something that is not there."""
    scene = objective.task.scene()
    objects = [item.name for item in scene.objects]
    moving = [item.name for item in scene.moving]
    for name, test in objective.test.items():
        named = [body for body in test.bodies() if isinstance(body, str)]
        types = [body for body in test.bodies() if not isinstance(body, str)]
        _expect(name, "allowed block type", types, objective.blocks)
        _expect(name, "moving object of the scene", named, moving)
        _expect(name, "object of the scene", test.obstacles(), objects)


def _expect(test: str, kind: str, wanted: Iterable[object], known: Collection[object]) -> None:
    if missing := [name for name in wanted if name not in known]:
        raise ConfigError(f"test.{test}: {UnknownNameError(kind, missing[0], known or ['none'])}")

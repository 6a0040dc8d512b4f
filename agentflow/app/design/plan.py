"""Run plans: a configuration with every name looked up, and the conditions of the run."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from agentflow.agents.base import first_prompt
from agentflow.agents.designer import Designer
from agentflow.agents.registry import ROLES
from agentflow.app.design.conditions import (
    PLUGINS,
    commit,
    describe_changes,
    plugins_of,
    recorded_plugins,
)
from agentflow.app.design.config import config_json
from agentflow.app.sketch import SKETCH, Sketch
from agentflow.config.run import DesignConfig, build_config, suggest_key
from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.engines import choose_engine, physics_conditions, usable_engine
from agentflow.env.physics.registry import ENGINES
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.records import record_of
from agentflow.env.tasks.registry import FAMILIES, Level, get_level, make_task, recorded_level
from agentflow.errors import ConfigError, UsageError
from agentflow.files.faults import explain
from agentflow.llm.procedural.mechanisms import STAND, purpose
from agentflow.machine import Brief, check, read_machine
from agentflow.machine.blocks.library import LATER
from agentflow.models.choices import choose_models
from agentflow.models.local.folder import read_folder
from agentflow.prompts.folder import PromptFolder, read_record
from agentflow.prompts.render import (
    CONTROLLERS,
    CONTROLS,
    ELSEWHERE,
    LATER_FUNCTIONS,
    WISHES,
    PromptSet,
    open_set,
)
from agentflow.runs.events import StageBeginEvent, read_typed_events
from agentflow.runs.locations import STAGES
from agentflow.search.elites.archive import require_pyribs
from agentflow.search.settings import MAP_ELITES, SearchSettings
from agentflow.search.strategies import extras, options_model
from agentflow.version import __version__
from agentflow.workflows.registry import WORKFLOWS, check_fit
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.tools import repetition_of
from agentflow.workflows.workflow import Workflow

AUTHOR = "author"
"""Key of run.yaml: who designed and cannot be asked again."""
_PROMPTS = "prompt_folder"
"""Key of run.yaml: what the folder of prompts held."""


@dataclass(frozen=True)
class RunPlan:
    """A configuration whose names have all been looked up.

    Its configuration names the engine that `auto` stands for here, so that a run keeps its engine;
    `engine` is its name and version, such as "pybullet 3.2.7". `level` is that of the task, without
    the configured knobs, and `sketch` that of the user, as models see it.
    """

    config: DesignConfig
    task: Task
    prompts: PromptSet
    engine: str
    level: Level
    sketch: Sketch | None = None

    @cached_property
    def brief(self) -> Brief:
        """The task as its designers see it, with the user's wishes and sketch."""
        wishes, sketch = self.config.settings.brief, self.sketch
        shown = (sketch.url,) if sketch else ()
        return replace(self.task.brief, wishes=wishes or "", sketch=shown)

    @cached_property
    def _asked(self) -> tuple[str, ...]:
        """The roles that the workflow asks for this task."""
        calls = WORKFLOWS[self.config.workflow].calls_on(self.config.settings, self.task.brief)
        return tuple(role for role, count in calls.items() if count)

    @property
    def good(self) -> float | None:
        """The good score of the level; None if its knobs are changed."""
        return None if self.config.knobs else self.level.file.good

    @property
    def record(self) -> float | None:
        """The verified score of the task's record, if designers are to know it."""
        found = record_of(self.task) if self.config.settings.tell_record else None
        return found.verified if found else None

    @classmethod
    def of(
        cls,
        config: DesignConfig,
        level: Level | None = None,
        prompts: PromptFolder | None = None,
        sketch: Sketch | None = None,
    ) -> RunPlan:
        """Look up task, knobs, workflow, prompt set and engine.

        Args:
            config: The configuration.
            level: Its level, as recorded in a run; by default that of the current name or file.
            prompts: Its folder of prompts, as recorded in a run; by default as it is now.
            sketch: Its sketch, as recorded in a run; by default that of the configured file.

        Raises:
            UnknownNameError: One of them does not exist.
            ConfigError: A knob is unknown or out of range, a price is missing, or the physics
                engine is not installed.
            UsageError: The workflow does not support the task, or the sketch cannot be shown.
        """
        _check_options(config.settings.search)
        WORKFLOWS[config.workflow]  # a known name
        choose_models(config.model, config.settings.models)
        engine = choose_engine(config.engine)
        try:
            level = level or get_level(config.task)
            task = make_task(level, config.knobs, engine.name)
        except ConfigError as error:
            raise ConfigError(f"{error}{suggest_key(config.knobs)}") from None
        check_fit(config.workflow, task.brief)
        _check_start(config.settings, task.brief)
        config = config.model_copy(update={"engine": engine.name})
        found = open_set(config.prompts, prompts)
        if prompts is None:
            found.require_use(ROLES)
        if sketch is None and config.settings.sketch is not None:
            sketch = Sketch.read(Path(config.settings.sketch))
        return cls(config, task, found, str(engine.identity), level, sketch)

    @classmethod
    def of_run(cls, path: Path, document: Mapping[str, Any], engine: str | None = None) -> RunPlan:
        """The plan of the run at `path`, whose run.yaml holds `document`, with its own level.

        Args:
            path: The run directory.
            document: The content of its run.yaml.
            engine: Name of an engine in place of the run's own.

        Raises:
            ConfigError: The engine is not installed.
        """
        if engine is None:
            engine = require_engine_of_run(path, document)
        config = build_config(document.get("config")).model_copy(update={"engine": engine})
        record, source = document.get(_PROMPTS), f"{_PROMPTS} in {path / 'run.yaml'}"
        prompts = None if record is None else read_record(record, source)
        sketch = Sketch.of_run(path, document) if config.settings.sketch else None
        return cls.of(config, level_of_run(path, document), prompts, sketch)

    def require_workflow(self) -> None:
        """Raise ConfigError unless the workflow can begin here.

        It may need a program, pyribs, or roles that a model in a folder cannot play. Each role
        renders a prompt, so that a template which is missing or wrong costs no call.
        """
        workflow, settings = WORKFLOWS[self.config.workflow], self.config.settings
        workflow.require(settings)
        for role in workflow.calls_on(settings, self.task.brief):
            with ROLES.blaming(role):
                first_prompt(ROLES[role], self.brief, self.prompts)
        if workflow.adapt(settings).search.strategy == MAP_ELITES:
            require_pyribs()
        others = [role for role in self._roles_of_designing_model() if role != Designer.name]
        if others:
            raise ConfigError(
                f"{self.config.model.name} writes whole machines and nothing else, but the "
                f"workflow {self.config.workflow}, as configured, also asks it to be "
                f"{' and '.join(others)}; use --workflow single --set search.rounds=0, or another "
                "model"
            )

    def require_sight(self) -> None:
        """Raise ConfigError unless the configured models can be shown the sketch, if any."""
        if self.sketch is None:
            return
        seeing = [role for role in self._asked if ROLES[role].sees]
        if not seeing:
            raise ConfigError(
                f"the workflow {self.config.workflow}, as configured, asks no role that is shown a "
                "sketch: leave it out, or use --workflow hierarchical without a start machine"
            )
        choices = choose_models(self.config.model)
        for role in seeing:
            if (choice := choices[ROLES[role].model_role or role]).local:
                raise ConfigError(
                    f"the {role} is played by {choice.display_name}, which sees no pictures: "
                    "leave the sketch out, or name a model that sees with --model"
                )

    def _roles_of_designing_model(self) -> list[str]:
        """The roles that the workflow asks of a model that only designs whole machines."""
        model = self.config.model
        if model.label is None or not read_folder(Path(model.name)).whole_machines_only:
            return []
        return [role for role in self._asked if (ROLES[role].model_role or role) not in model.roles]

    @property
    def conditions(self) -> dict[str, Any]:
        """Everything besides configuration and replies that decides results, for run.yaml.

        Hashes have 16 hex digits; `demands` is that of the task's brief. `plugins` holds the
        identity of each part from another distribution, by kind and name; see `Registry.identity`.
        """
        return {
            "prompts": self.prompts.digest_for(
                (
                    *WORKFLOWS[self.config.workflow].calls(self.config.settings),
                    *([ELSEWHERE] if self.config.settings.shows_elsewhere else []),
                    *([WISHES] if self.config.settings.brief or self.sketch else []),
                    *([CONTROLS] if self.task.schedule.designed else []),
                    *([CONTROLLERS] if self.task.brief.limits.senses else []),
                    *([LATER_FUNCTIONS] if LATER.intersection(self.task.brief.blocks) else []),
                )
            ),
            "demands": hashlib.sha256(self.task.brief.wording.encode()).hexdigest()[:16],
            **physics_conditions(self.task.engine),
            "engine": self.engine,
            PLUGINS: plugins_of(self.config, self.level.file.family),
        }

    def changes_since(self, document: Mapping[str, Any]) -> str:
        """Which conditions differ from those in a run.yaml; see `describe_changes`."""
        return describe_changes(document, self.conditions)

    def notes_on(self, path: Path, document: Mapping[str, Any]) -> Iterator[str]:
        """Messages about the run at `path`, whose run.yaml holds `document`: it names no engine,
        or its level has changed."""
        if "engine" not in document:
            yield f"{path}: the run does not record its physics engine; now it is {self.engine}"
        if note := level_note(path, document):
            yield note

    @property
    def model_note(self) -> str:
        """A message if the model cannot do what others can; "" if it can.

        The procedural model may not know the purpose of the task: it then builds machines that
        stand or drive. Models from scratch write whole machines, but revise none.
        """
        if self._roles_of_designing_model():
            return (
                f"{self.config.model.name} writes whole machines and nothing else: workflow "
                f"{self.config.workflow}, without revisions"
            )
        choices = choose_models(self.config.model)
        asked = {ROLES[role].model_role or role for role in self._asked}
        if self.config.settings.brief and all(choices[role].procedural for role in asked):
            return "the procedural model does not read the user's wishes; a language model would"
        if not any(choices[role].procedural for role in asked) or purpose(self.task.brief) != STAND:
            return ""
        return (
            f"the procedural model has no mechanism for {self.task.name}, so expect low scores; "
            "use a language model (--model), or add mechanisms for the family (CONTRIBUTING.md)"
        )

    @property
    def run_name(self) -> str:
        """Default name of the run directory: date, task, workflow and seed."""
        stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
        task = self.task.name.replace("/", "-")
        return f"{stamp}-{task}-{self.config.workflow}-seed{self.config.seed}"

    @property
    def run_document(self) -> dict[str, Any]:
        """Content of run.yaml: the resolved configuration, the conditions, and provenance."""
        return {
            "agentflow": __version__,
            "commit": commit(),
            **self.conditions,
            "began": datetime.now(timezone.utc).isoformat(timespec="seconds"),
            "python": platform.python_version(),
            "platform": platform.platform(),
            "level": self.level.record,
            **({_PROMPTS: self.prompts.folder.model_dump()} if self.prompts.folder else {}),
            **({SKETCH: self.sketch.digest} if self.sketch else {}),
            "config": config_json(self.config),
        }


def require_engine_of_run(path: Path, document: Mapping[str, Any]) -> str:
    """Name of the engine of the run at `path`; raises ConfigError if it is not installed."""
    name = engine_of_run(document)
    if usable_engine(name) != name:
        how = f" (pip install {ENGINES[name].libraries[0]})" if name in ENGINES else ""
        raise ConfigError(
            f"{path} was made with {document.get('engine') or name}, which is not installed{how}; "
            "agentflow rescore simulates its machines with another engine"
        )
    return name


def _check_options(search: SearchSettings) -> None:
    """Raise UnknownNameError or ConfigError unless the strategy exists and takes its options."""
    try:
        extras(search)
    except ValidationError as error:
        told = explain(error, options_model(search.strategy) or SearchSettings, "option")
        raise ConfigError(f"settings.search.options of {search.strategy}: {told}") from None


def _check_start(settings: WorkflowSettings, brief: Brief) -> None:
    """Raise UsageError if there is a start machine that is not valid for the task."""
    reading = read_machine(settings.start_data, brief.blocks, brief.given)
    if settings.start and not (report := check(reading, brief)).task_valid:
        raise UsageError(
            f"the start machine is not valid for {brief.name}: {report.problems[0].message}"
        )


def level_of_run(path: Path, document: Mapping[str, Any]) -> Level:
    """The level of a run as it was when the run began.

    Args:
        path: The run directory.
        document: The content of its run.yaml.

    Raises:
        ConfigError: It is damaged, or its task family is not installed.
    """
    record = document.get("level")
    if not isinstance(record, Mapping):  # made before levels were recorded
        return get_level(build_config(document.get("config")).task)
    level = recorded_level(record, f"the level in {path / 'run.yaml'}")
    if level.file.family not in FAMILIES:
        kind = f"{FAMILIES.kind} {level.file.family}"
        origin = recorded_plugins(document).get(kind, "another version of agentflow")
        raise ConfigError(f"{path} needs the task family {level.file.family!r} of {origin}")
    return level


def repetition(path: Path, document: Mapping[str, Any]) -> Workflow | None:
    """What does a run again, as far as it is recorded, whose author cannot be asked again.

    Args:
        path: The run directory.
        document: The content of its run.yaml.

    Returns:
        None if the configured workflow does it again.
    """
    if AUTHOR not in document:
        return None
    events = read_typed_events(path)
    begun = {event.location.name for event in events if isinstance(event, StageBeginEvent)}
    stages = tuple(stage for stage in STAGES if stage in begun)
    return repetition_of(document[AUTHOR], stages or STAGES[-1:])


def task_of_run(path: Path, document: Mapping[str, Any]) -> Task:
    """The task of a run as it was when the run began; see `level_of_run`."""
    knobs = build_config(document.get("config")).knobs
    return make_task(level_of_run(path, document), knobs, engine_of_run(document))


def engine_of_run(document: Mapping[str, Any]) -> str:
    """Name of the engine that a run began with; `AUTO` if its run.yaml does not name one."""
    engine = build_config(document.get("config")).engine
    name, _, _ = str(document.get("engine", AUTO)).rpartition(" ")
    return name if engine == AUTO and name else engine


def level_note(path: Path, document: Mapping[str, Any]) -> str:
    """A message if the level of a run has changed since, or is no longer there; else ""."""
    level = level_of_run(path, document)
    try:
        change = "" if get_level(level.name).file == level.file else "has changed since"
    except UsageError:
        change = "cannot be read here"
    used = "its copy in the run is used"
    return f"{path}: the level {level.name} {change}; {used}" if change else ""

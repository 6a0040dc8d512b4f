"""What the command line offers and lists is what there is to choose from."""

from __future__ import annotations

import re
from inspect import unwrap
from typing import Literal, get_args, get_origin, get_type_hints

import pytest

from agentflow.agents.registry import ROLES
from agentflow.app.diagnose.run import DIAGNOSTICS
from agentflow.app.machines.convert import FORMATS as FILE_FORMATS
from agentflow.app.pages.registry import PAGES
from agentflow.app.plugins.scaffold import KINDS
from agentflow.app.pools import Where
from agentflow.app.sweeps.registry import VIEWS as SWEEP_VIEWS
from agentflow.config.run import DesignConfig
from agentflow.env.drawing.cameras import VIEWS as CAMERA_VIEWS
from agentflow.env.physics.registry import ENGINES
from agentflow.machine.formats.detect import Form
from agentflow.metrics.tables import FORMATS
from agentflow.notebook.figures.plot import DRAWN
from agentflow.notebook.words import By
from agentflow.prompts.registry import PROMPT_SETS
from agentflow.study.episodes import Label
from agentflow.training.views import VIEWS as TRAINING_VIEWS
from agentflow.workflows.registry import WORKFLOWS
from tests.cli.test_help import COMMANDS

OFFERED = {
    ("check", "form"): get_args(Form),
    ("design", "keep_rollouts"): get_args(DesignConfig.model_fields["keep_rollouts"].annotation),
    ("diagnose", "name"): tuple(DIAGNOSTICS),
    ("new-plugin", "kind"): tuple(KINDS),
    ("plot", "view"): tuple(DRAWN),
    ("plot", "by"): get_args(By),
    ("table", "show"): tuple(dict.fromkeys((*SWEEP_VIEWS, *TRAINING_VIEWS))),
}
OF_SEVERAL = {
    "form": [tuple(FORMATS), tuple(name for name in FORMATS if name != "json")],
    "backend": [get_args(Where)],
}
"""Options of several commands, and what these may offer."""
OWN = {("simulate", "power")}
"""Choices that only the command itself has."""
LISTED = {
    ("convert", "out"): FILE_FORMATS,
    ("diagnose", "name"): DIAGNOSTICS,
    ("design", "workflow"): WORKFLOWS.ours,
    ("prompts show", "name"): PROMPT_SETS.ours,
    ("prompts show", "role"): ROLES.ours,
    ("render", "view"): (*CAMERA_VIEWS, "sheet"),
    ("report", "page"): PAGES.ours,
    ("table", "show"): (*SWEEP_VIEWS, *TRAINING_VIEWS),
    **{(name, "engine"): ("auto", *ENGINES.ours) for name in ("design", "simulate", "sweep")},
}


def choices() -> dict[tuple[str, str], tuple[str, ...]]:
    """Command and parameter -> what can be chosen, of all parameters with choices."""
    return {
        (name, parameter): chosen
        for name, command in COMMANDS.items()
        if command.callback is not None
        for parameter, kind in get_type_hints(unwrap(command.callback)).items()
        if (chosen := literals(kind))
    }


def literals(kind: object) -> tuple[str, ...]:
    """The members of a Literal, also of an optional one."""
    if get_origin(kind) is Literal:
        return get_args(kind)
    return tuple(item for part in get_args(kind) for item in literals(part))


def test_every_choice_is_that_of_its_owner() -> None:
    for (command, option), found in choices().items():
        if (command, option) in OFFERED:
            assert found == OFFERED[command, option], (command, option)
        elif (command, option) not in OWN:
            assert found in OF_SEVERAL[option], (command, option)
    assert {*OFFERED, *OWN} <= choices().keys()


@pytest.mark.parametrize(("command", "option"), LISTED)
def test_a_help_lists_what_there_is(command: str, option: str) -> None:
    (item,) = (item for item in COMMANDS[command].params if item.name == option)
    missing = {*LISTED[command, option]} - {*re.findall(r"[\w.-]*[\w]", item.help)}
    assert missing == set()


def test_the_labels_of_episodes_are_listed() -> None:
    missing = {*get_args(Label)} - {*re.findall(r"\w+", COMMANDS["study segments"].help)}
    assert missing == set()

"""Writes a package with one part of one's own, which can be installed, and with its test."""

import keyword
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import jinja2

from agentflow.agents.registry import ROLES
from agentflow.env.tasks.registry import FAMILIES
from agentflow.errors import UsageError
from agentflow.files.atomic import os_errors
from agentflow.metrics.cells import METRICS
from agentflow.prompts.registry import PROMPT_SETS
from agentflow.prompts.render import PromptSet, templates_in
from agentflow.registry import Registry
from agentflow.search.registry import STRATEGIES

Kind = Literal["family", "strategy", "role", "metric", "prompts"]
NAME, CLASS = "NAME", "CLASS"
"""Stand for the names of the package, in paths of templates as well, and of its class."""


@dataclass(frozen=True)
class _About:
    """What a new package of a kind has.

    `use` is a command that uses the part; `entries` maps groups of entry points, without
    `agentflow.`, to what they name.
    """

    registry: Registry[Any]
    use: str
    entries: Mapping[str, str]


KINDS: Mapping[Kind, _About] = MappingProxyType(
    {
        "family": _About(FAMILIES, "agentflow design --task NAME", {"families": "NAME.task:CLASS"}),
        "strategy": _About(
            STRATEGIES,
            "agentflow design --set search.strategy=NAME",
            {"strategies": "NAME.strategy:NAME"},
        ),
        "role": _About(
            ROLES,
            "agentflow design --workflow NAME",
            {"roles": "NAME.role:CLASS", "workflows": "NAME.role:WORKFLOW"},
        ),
        "metric": _About(
            METRICS, "table: {metrics: [NAME]}  # in a sweep", {"metrics": "NAME.metric:METRIC"}
        ),
        "prompts": _About(PROMPT_SETS, "agentflow design --set prompts=NAME", {"prompts": "NAME"}),
    }
)


_LANGUAGE = jinja2.Environment(
    variable_start_string="<<",
    variable_end_string=">>",
    block_start_string="<%",
    block_end_string="%>",
    comment_start_string="<#",
    comment_end_string="#>",
    undefined=jinja2.StrictUndefined,
    autoescape=False,
    trim_blocks=True,
    keep_trailing_newline=True,
)
"""Templates of templates: what they write may hold Jinja of its own."""


@dataclass(frozen=True)
class NewPlugin:
    """A package that was written.

    `files` are paths in its folder; `use` says how to use the part once it is installed.
    """

    path: Path
    files: tuple[str, ...]
    use: str


def new_plugin(path: Path, kind: Kind) -> NewPlugin:
    """Write a package with one part, which is named after the folder.

    Raises:
        UsageError: The folder is not empty or cannot be written, or its name is not free.
    """
    package = re.sub(r"\W", "_", path.resolve().name.lower())
    class_name = "".join(word.capitalize() for word in package.split("_"))
    about = KINDS[kind]
    _require_free(path, package, about.registry)
    variables = {
        "package": package,
        "class_name": class_name,
        "kind": about.registry.kind,
        "entries": {
            group: target.replace(NAME, package).replace(CLASS, class_name)
            for group, target in about.entries.items()
        },
        "usual": PromptSet().files["designer/system.j2"].rstrip("\n"),
    }
    home = resources.files(__package__).joinpath("templates")
    files = {
        name.replace(NAME, package).removesuffix(".j2"): _LANGUAGE.from_string(text).render(
            variables
        )
        for folder in ("shared", kind)
        for name, text in templates_in(home.joinpath(folder))
    }
    with os_errors(f"cannot write to {path}"):
        for name, text in files.items():
            (path / name).parent.mkdir(parents=True, exist_ok=True)
            (path / name).write_text(text, encoding="utf-8")
    return NewPlugin(path, tuple(sorted(files)), about.use.replace(NAME, package))


def _require_free(path: Path, package: str, registry: Registry[Any]) -> None:
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise UsageError(f"{path} is not empty: name a new folder")
    if not package.isidentifier() or keyword.iskeyword(package):
        raise UsageError(f"{path.name!r} cannot name a package: use letters, digits and _")
    if find_spec(package) is not None or package in registry:
        raise UsageError(
            f"there is already a package or {registry.kind} {package!r}: choose another name"
        )

"""Render prompts from sets of Jinja templates, strictly and in one pass."""

from __future__ import annotations

import hashlib
import traceback
from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import cache, cached_property
from importlib import resources
from typing import TYPE_CHECKING, Any

import jinja2
import yaml

from agentflow.errors import PromptError, UnknownNameError
from agentflow.prompts.registry import ABOUT, PROMPT_SETS
from agentflow.prompts.text import CL100K, as_json, clip, guard, oneline, quote, token_estimate

if TYPE_CHECKING:  # Python 3.14 has it in importlib.resources.abc only, 3.10 here only
    from importlib.abc import Traversable

_ROOM = (1.0, 0.5, 0.25, 0.0)
"""Shares of the usual space for long sections, tried one after another until a prompt fits."""
_FACTS, _FUNCTIONS = "facts.yaml", "block_functions.yaml"
LATER_FUNCTIONS = "block_functions_later.yaml"
"""What blocks do that came later, which must not change the digests of runs without them."""
_RETRY = "_parts/retry.j2"
_REPLY = "\n## Your reply\n"
CONTROLS = "_controls"
"""Folder of what is added to every prompt of a task with control programs."""
ELSEWHERE = "_elsewhere"
"""Folder of what is added to prompts that show what was learnt elsewhere."""
_APART = frozenset({"agent", "drafter", "_questions", "_sessions", CONTROLS, ELSEWHERE})
"""Folders that came later, whose templates must not change the digests of runs without them: a run
records the digest of its prompts, and can be continued and replayed only with the same ones. So
each counts only for what uses it; `agent` and `drafter` are roles like others, but younger than
recorded runs."""


@cache
def facts() -> Mapping[str, Any]:
    """Measured numbers of physics that prompts state."""
    loaded: dict[str, Any] = yaml.safe_load(_home().joinpath(_FACTS).read_text("utf-8"))
    return loaded


@cache
def block_functions() -> Mapping[int, str]:
    """One line per block type on what it does: the last column of the Blocks table."""
    texts = (_home().joinpath(name).read_text("utf-8") for name in (_FUNCTIONS, LATER_FUNCTIONS))
    lines = (item for text in texts for item in yaml.safe_load(text).items())
    return {kind: line.format(**facts()) for kind, line in lines}


class PromptSet:
    """A named folder of templates: `<role>/system.j2`, `<role>/user.j2` and shared `_parts/`.

    A set based on another contains only the templates that differ. Variables are inserted as they
    are and never rendered again; a missing variable is an error.
    """

    def __init__(self, name: str = "default") -> None:
        """Open a set.

        Raises:
            UnknownNameError: No set has this name.
            ConfigError: The set is from another distribution and cannot be loaded.
        """
        self.name, folder = name, resources.files(PROMPT_SETS[name])
        about = yaml.safe_load(folder.joinpath(ABOUT).read_text("utf-8"))
        self.about: str = about["about"]
        """Description of the set in one sentence."""
        self.files = dict(_walk(folder, ""))
        """Path of each template -> its text."""
        if base := about.get("base"):
            self.files = {**PromptSet(base).files, **self.files}
        self.fits: int | None = about.get("fits")
        """Token limit that prompts are shortened to where possible; None for no limit."""
        self._environment = _environment(self.files)

    @cached_property
    def digest(self) -> str:
        """Content hash (16 hex digits) of everything that affects the set's prompts."""
        return self.digest_for(())

    def digest_for(self, folders: Collection[str]) -> str:
        """The digest for what uses these folders; templates in `_APART` count only if named, and
        so does `LATER_FUNCTIONS`."""
        later = {LATER_FUNCTIONS}.intersection(folders)
        names = (_FACTS, _FUNCTIONS, *later)
        shared = {name: _home().joinpath(name).read_text("utf-8") for name in names}
        files = {**self.files, **shared}
        files |= {ABOUT: str(self.fits)} if self.fits else {}
        digest = hashlib.sha256()
        for path in sorted(files):
            if (folder := path.partition("/")[0]) in _APART and folder not in folders:
                continue
            digest.update(f"{path}\0{files[path]}\0".encode())
        return digest.hexdigest()[:16]

    @property
    def roles(self) -> tuple[str, ...]:
        """Names of the roles that the set has prompts for."""
        folders = {path.partition("/")[0] for path in self.files}
        return tuple(sorted(folder for folder in folders if not folder.startswith("_")))

    def render(self, role: str, variables: Mapping[str, object]) -> tuple[str, str]:
        """Render the system and the user prompt of a role, or of a question in `_questions/`.

        Sets with a token limit shorten long sections: the variable `room`, the share of the usual
        space, is lowered until the prompts fit.

        Raises:
            UnknownNameError: The set has no prompts for this role.
            PromptError: A variable is missing; the message names template and variable.
        """
        if f"{role}/user.j2" not in self.files:
            raise UnknownNameError("role", role, self.roles)
        for room in _ROOM:
            given = {**variables, "room": room}
            system = self._render(f"{role}/system.j2", given)
            edits = role == "agent" or variables.get("format") == "steps"
            user = self._with_controls(self._render(f"{role}/user.j2", given), given, edits)
            if given.get("elsewhere"):
                user = _insert(user, self._render(f"{ELSEWHERE}/elsewhere.j2", given))
            if not self.fits or CL100K * token_estimate(system + user) <= self.fits:
                break
        return system, user

    def render_parts(self, names: Iterable[str], variables: Mapping[str, object]) -> str:
        """Render shared parts one after another, at full length.

        Raises:
            PromptError: A variable is missing; the message names template and variable.
        """
        given = {**variables, "room": _ROOM[0]}
        text = "\n".join(self._render(f"_parts/{name}.j2", given) for name in names)
        return self._with_controls(text, given, edits=True)

    def _with_controls(self, text: str, variables: Mapping[str, object], edits: bool) -> str:
        """A prompt with the rules of control programs before what it asks for, if its task has
        such programs; `edits` adds the commands that change them."""
        if not variables.get("controls"):
            return text
        rules = self._render(f"{CONTROLS}/controls.j2", {**variables, "edits": edits})
        return _insert(text, rules)

    def retry(self, problem: str) -> str:
        """Render the message that rejects a reply and gives the reason."""
        return self._render(_RETRY, {"problem": problem})

    def _render(self, template: str, variables: Mapping[str, object]) -> str:
        try:
            return self._environment.get_template(template).render(variables).strip() + "\n"
        except jinja2.UndefinedError as error:
            # jinja shows templates as frames; the last one may be an included part
            names = [frame.filename for frame in traceback.extract_tb(error.__traceback__)]
            place = [template, *(name for name in names if name.endswith(".j2"))][-1]
            raise PromptError(f"prompt set {self.name!r}, {place}: {error.message}") from error
        except jinja2.TemplateError as error:
            raise PromptError(f"prompt set {self.name!r}, {template}: {error}") from error


def _insert(prompt: str, section: str) -> str:
    """Put a section before what a prompt asks for."""
    before, heading, after = prompt.rpartition(_REPLY)
    return f"{before}\n{section}{heading}{after}" if heading else f"{prompt}\n{section}"


def _home() -> Traversable:
    return resources.files("agentflow.prompts")


def _walk(folder: Traversable, prefix: str) -> Iterator[tuple[str, str]]:
    """Yield the templates under a folder as (path with slashes, text)."""
    for item in folder.iterdir():
        if item.is_dir():
            yield from _walk(item, f"{prefix}{item.name}/")
        elif item.name.endswith(".j2"):
            yield f"{prefix}{item.name}", item.read_text("utf-8")


def _environment(files: Mapping[str, str]) -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(
            lambda path: (files[path], path, None) if path in files else None
        ),
        undefined=jinja2.StrictUndefined,
        autoescape=False,
        trim_blocks=True,
        keep_trailing_newline=True,
        lstrip_blocks=True,
    )
    filters = {"quote": quote, "guard": guard, "oneline": oneline, "as_json": as_json, "clip": clip}
    environment.filters.update(filters)
    environment.globals["facts"] = facts()
    return environment

"""Render prompts from sets of Jinja templates, strictly and in one pass."""

from __future__ import annotations

import hashlib
import traceback
from collections.abc import Collection, Iterable, Iterator, Mapping
from copy import copy
from difflib import get_close_matches
from functools import cache, cached_property
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2
import yaml
from jinja2.meta import find_referenced_templates
from jinja2.sandbox import ImmutableSandboxedEnvironment

from agentflow.errors import PromptError, UnknownNameError
from agentflow.prompts.folder import PromptFolder, is_folder, read_folder
from agentflow.prompts.registry import ABOUT, DEFAULT, PROMPT_SETS
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
CONTROLLERS = "_controllers"
"""Folder of what follows it where machines may also bring controllers."""
ELSEWHERE = "_elsewhere"
"""Folder of what is added to prompts that show what was learnt elsewhere."""
WISHES = "_wishes"
"""Folder of what is added to prompts of a task with the user's wishes or sketch."""
_APART = frozenset(
    (
        *("agent", "analyst", "drafter", "_questions", "_sessions"),
        *(CONTROLS, CONTROLLERS, ELSEWHERE, WISHES),
    )
)
"""Folders that came later, whose templates must not change the digests of runs without them: a run
records the digest of its prompts, and can be continued and replayed only with the same ones. So
each counts only for what uses it; `agent`, `analyst` and `drafter` are roles like others, but
younger than recorded runs."""


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

    def __init__(self, name: str = DEFAULT, folder: PromptFolder | None = None) -> None:
        """Open a set.

        Args:
            name: Its name, or the path of a folder, which has a slash in it.
            folder: What a run has recorded of the folder, in place of what is there now.

        Raises:
            UnknownNameError: No set has this name.
            ConfigError: The set is from another distribution, or a folder, and cannot be read.
        """
        self.name = name
        self.folder = read_folder(name) if folder is None and is_folder(name) else folder
        """What the folder holds; None for a set with a name."""
        if self.folder is None:
            package = resources.files(PROMPT_SETS[name])
            about = yaml.safe_load(package.joinpath(ABOUT).read_text("utf-8"))
            own = dict(templates_in(package))
        else:
            about, own = self.folder.model_dump(), self.folder.files
        self.about: str = about["about"]
        """Description of the set in one sentence."""
        base = about.get("base")
        self.files: dict[str, str] = {**PromptSet(base).files, **own} if base else own
        """Path of each template -> its text."""
        self.fits: int | None = about.get("fits")
        """Token limit that prompts are shortened to where possible; None for no limit."""
        self._environment = _environment(self.files, trusted=self.folder is None)
        self._completed: dict[str, PromptSet] = {}
        """By role, with its own templates."""

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

    def require_use(self, roles: Iterable[str]) -> None:
        """Raise PromptError if a folder holds a template that neither roles nor templates use."""
        if self.folder is None:
            return
        asked = {f"{role}/{part}.j2" for role in roles for part in ("system", "user")}
        known = asked | PromptSet(self.folder.base).files.keys()
        included: set[str | None] = set()
        for path, text in self.files.items():
            try:
                included |= {*find_referenced_templates(self._environment.parse(text))}
            except jinja2.TemplateSyntaxError as error:
                place = f"prompt set {self.name!r}, {path}, line {error.lineno}"
                raise PromptError(f"{place}: {error.message}") from error
        for path in sorted(self.folder.files.keys() - known - included):
            close = "".join(f"; did you mean {one}?" for one in get_close_matches(path, known, 1))
            raise PromptError(f"prompt set {self.name!r}: nothing uses {path}{close}")

    def completed(self, role: str, templates: Path | None) -> PromptSet:
        """The set with a role's own templates, from a folder, where it lacks the role's."""
        if templates is None:
            return self
        if role not in self._completed:
            own = {f"{role}/{file.name}": file for file in templates.glob("*.j2")}
            lacking = {path: own[path].read_text("utf-8") for path in own.keys() - self.files}
            self._completed[role] = found = copy(self)
            found.files = {**self.files, **lacking}
            found._environment = _environment(found.files, trusted=self.folder is None)
        return self._completed[role]

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
            if given.get("wishes") or (given.get("sketch") and given.get("sees")):
                user = _insert(user, self._render(f"{WISHES}/wishes.j2", given))
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
        controls = variables.get("controls")
        if not isinstance(controls, Mapping):
            return text
        given = {**variables, "edits": edits}
        rules = self._render(f"{CONTROLS}/controls.j2", given)
        if controls["senses"]:
            rules += self._render(f"{CONTROLLERS}/controllers.j2", given)
        return _insert(text, rules)

    def retry(self, problem: str) -> str:
        """Render the message that rejects a reply and gives the reason."""
        return self._render(_RETRY, {"problem": problem})

    def _render(self, template: str, variables: Mapping[str, object]) -> str:
        try:
            return self._environment.get_template(template).render(variables).strip() + "\n"
        except jinja2.TemplateError as error:
            # jinja shows templates as frames; the last one may be an included part
            frames = traceback.extract_tb(error.__traceback__)
            places = [(f.filename, f.lineno) for f in frames if f.filename.endswith(".j2")]
            if isinstance(error, jinja2.TemplateSyntaxError):
                places.append((error.name or template, error.lineno))
            path, line = [(template, None), *places][-1]
            what, known = error.message, ", ".join(sorted(variables))
            if isinstance(error, jinja2.TemplateNotFound):
                what = f"there is no template {error.name}"
            elif isinstance(error, jinja2.UndefinedError) and "attribute" not in str(what):
                what = f"{what}; known: {known}"
            place = f"{path}, line {line}" if line else path
            raise PromptError(f"prompt set {self.name!r}, {place}: {what}") from error


def _insert(prompt: str, section: str) -> str:
    """Put a section before what a prompt asks for."""
    before, heading, after = prompt.rpartition(_REPLY)
    return f"{before}\n{section}{heading}{after}" if heading else f"{prompt}\n{section}"


def open_set(name: str, folder: PromptFolder | None = None) -> PromptSet:
    """`PromptSet`, whose templates are compiled once if it has a name."""
    return PromptSet(name, folder) if folder or is_folder(name) else _named_set(name)


_named_set = cache(PromptSet)


def _home() -> Traversable:
    return resources.files("agentflow.prompts")


def templates_in(folder: Traversable, above: str = "") -> Iterator[tuple[str, str]]:
    """Path, with slashes, and text of each template under a folder."""
    for item in folder.iterdir():
        if item.is_dir():
            yield from templates_in(item, f"{above}{item.name}/")
        elif item.name.endswith(".j2"):
            yield f"{above}{item.name}", item.read_text("utf-8")


def _environment(files: Mapping[str, str], *, trusted: bool) -> jinja2.Environment:
    """Templates of a received folder can read what they are given, and call nothing else."""
    kind = jinja2.Environment if trusted else ImmutableSandboxedEnvironment
    environment = kind(
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

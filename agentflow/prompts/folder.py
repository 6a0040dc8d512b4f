"""A prompt set that is a folder of templates, not an installed package."""

from pathlib import Path

from pydantic import BaseModel, Field, ValidationError, field_validator

from agentflow.errors import ConfigError
from agentflow.files.faults import explain
from agentflow.files.lines import read_regular
from agentflow.files.yaml import read_yaml_file
from agentflow.prompts.registry import ABOUT, DEFAULT

MOST = 1 << 20
"""Most bytes of a template that are read."""


class PromptFolder(BaseModel, frozen=True, extra="forbid"):
    """What a folder holds; a run records it, and goes on without the folder.

    Attributes:
        about: What the set is for, in a sentence.
        base: The named set that has the templates that it lacks.
        fits: Token limit of system and user prompt.
        files: Path of each template -> its text.
    """

    about: str = ""
    base: str = DEFAULT
    fits: int | None = Field(None, ge=1)
    files: dict[str, str] = {}

    @field_validator("base")
    @classmethod
    def _name_a_set(cls, base: str) -> str:
        if is_folder(base):  # a run records one folder, and goes on without it
            raise ValueError("must be the name of a prompt set, not the path of a folder")
        return base


def is_folder(name: str) -> bool:
    """Whether a prompt set is named by the path of its folder."""
    return "/" in name or "\\" in name


def read_folder(name: str) -> PromptFolder:
    """Read `<role>/system.j2`, `<role>/user.j2` and `set.yaml`, which may be missing.

    Raises:
        ConfigError: There is no such folder, it has no templates, or a file cannot be read.
    """
    folder = Path(name)
    settings = folder / ABOUT
    files = {
        path.relative_to(folder).as_posix(): _read(path) for path in sorted(folder.rglob("*.j2"))
    }
    if not files:
        what = "has no templates, such as designer/user.j2" if folder.is_dir() else "does not exist"
        raise ConfigError(f"the prompt set {name} {what}")
    try:
        about = read_yaml_file(settings, "the settings ") if settings.exists() else {}
        found = PromptFolder.model_validate(about)
    except ValidationError as error:
        raise ConfigError(f"{settings}: {explain(error, PromptFolder, 'key')}") from None
    return found.model_copy(update={"files": files})


def read_record(record: object, source: str) -> PromptFolder:
    """What a run has recorded of a folder; raises ConfigError if it is damaged."""
    try:
        return PromptFolder.model_validate(record)
    except ValidationError as error:
        raise ConfigError(f"{source}: {explain(error, PromptFolder, 'key')}") from None


def _read(path: Path) -> str:
    try:
        return read_regular(path, MOST).decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"the template {path} cannot be read: {error}") from None

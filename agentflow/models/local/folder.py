"""What a model folder says about itself: how it wants prompts, and its name in results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ValidationError

from agentflow.errors import ConfigError
from agentflow.files.documents import Document
from agentflow.files.faults import explain
from agentflow.files.lines import parse_object
from agentflow.models.local.shorthand import shorten

FILE_NAME = "agentflow.json"
MODEL = "model"
"""Folder of the model in a training directory."""
MODEL_FILES = ("config.json", "adapter_config.json")
"""One of them is in every folder that `transformers` loads: a model, or an adapter to one."""


Messages = Sequence[Mapping[str, str]]
"""A chat: `role` and `content` of each message."""


class ModelFolder(BaseModel, frozen=True, extra="forbid"):
    """The content of agentflow.json; a folder without the file is that of a chat model."""

    label: str
    """Name of the model in results."""
    prompts: Literal["chat", "shorthand"] = "chat"
    """`shorthand`: it was trained on short prompts and writes whole machines, nothing else."""
    format: Literal[1] = 1

    @property
    def whole_machines_only(self) -> bool:
        """Whether the designer of a whole machine is the only role that it can play."""
        return self.prompts == "shorthand"

    def prompt(self, messages: Messages) -> str | list[dict[str, str]]:
        """A prompt as the model was trained on it: a short text, or the messages of a chat.

        It is what `prompt` holds in the data sets of TRL's trainers.

        Raises:
            UsageError: The model cannot answer it.
        """
        return shorten(messages) if self.whole_machines_only else [dict(m) for m in messages]

    def save(self, path: Path) -> None:
        """Write it into the folder of a model."""
        Document(FILE_NAME, ModelFolder, "a model").write(path, self)


def read_folder(path: Path) -> ModelFolder:
    """What the folder of a model says; the name of a chat model's folder is its label.

    Raises:
        ConfigError: It holds no model, or its agentflow.json is damaged.
    """
    path = find_model(path)
    file = path / FILE_NAME
    if not file.exists():
        return ModelFolder(label=path.resolve().name)
    document = parse_object(file.read_bytes())
    if document is None:
        raise ConfigError(f"{file} is not a JSON object")
    try:
        return ModelFolder.model_validate(document)
    except ValidationError as error:
        raise ConfigError(f"{file}: {explain(error, ModelFolder, 'key')}") from None


def find_model(path: Path) -> Path:
    """The folder of a model: this one, or that of the model in this training directory.

    Raises:
        ConfigError: It holds neither.
    """
    for found in (path, path / MODEL):
        if any((found / name).is_file() for name in MODEL_FILES):
            return found
    raise ConfigError(
        f"{path} holds no model: it has neither {MODEL_FILES[0]} nor, as training directories "
        f"have when they are finished, {MODEL}/{MODEL_FILES[0]}"
    )

"""What a model folder says about itself: its name in results, how it wants prompts, such as the
short ones.

A model of a few million parameters cannot learn to read a prompt of four thousand tokens. It gets
the purpose that the procedural model reads out of the prompt's task, and the allowed types:
`throw 0 1 2 5 15 22 30 36<design>`. Its reply is a real one: a rationale, then a machine.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ValidationError

from agentflow.errors import ConfigError, UsageError
from agentflow.files.documents import Document
from agentflow.files.faults import explain
from agentflow.files.lines import parse_object
from agentflow.llm.messages import Message
from agentflow.llm.procedural.mechanisms import purpose
from agentflow.llm.procedural.reading import PromptContent, read_prompt

END = "<design>"
"""Special token that ends a short prompt; the reply follows."""
WHOLE = "First the rationale"
"""Words of the reply format of designers."""


def shorten(messages: Sequence[Mapping[str, str]]) -> str:
    """The short form of a prompt that asks for a whole machine.

    Args:
        messages: Chat messages with `role` and `content`. What follows the user's first message,
            such as a request to correct a reply, is left out: the model just tries again.

    Raises:
        UsageError: The prompt asks for something else.
    """
    content = {"system": messages[0]["content"], "user": ""}
    content |= {message["role"]: message["content"] for message in reversed(messages)}
    prompt = read_prompt(
        [Message(role="system", text=content["system"]), Message(role="user", text=content["user"])]
    )
    if not _asks_for_whole_machine(prompt):
        raise UsageError(
            "a model with short prompts writes whole machines as construction trees, and nothing "
            "else; use another model, or a workflow and settings that ask for nothing else, such "
            "as --workflow single --set search.rounds=0"
        )
    return f"{purpose(prompt.brief)} {' '.join(map(str, prompt.brief.blocks))}{END}"


def _asks_for_whole_machine(prompt: PromptContent) -> bool:
    other = ("Structure to build now", "Rationale to follow")
    return (
        WHOLE in prompt.sections["Your reply"]
        and not prompt.has_machine
        and not prompt.coordinates
        and not any(prompt.sections[heading] for heading in other)
    )


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

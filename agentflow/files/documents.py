"""The file in which a folder says what it holds, so that work in it can be continued.

Everything that fills a folder writes one first, reads it before it continues, and refuses to
continue something else. `Document` does this for the JSON of a pydantic model; runs and sweeps have
YAML, which people read.
"""

import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import AfterValidator, BaseModel, ValidationError

from agentflow.errors import RunError
from agentflow.files.atomic import os_errors, remove_partial_files, write_text
from agentflow.files.faults import explain
from agentflow.files.folders import out_errors, require_plain_files, visible_names
from agentflow.files.lines import parse_object, read_regular
from agentflow.files.yaml import FAST_LOADER, NOT_YAML, load_bounded

_Model = TypeVar("_Model", bound=BaseModel)

_SEAL = "seal"
_MOST_BYTES = 64 * 2**20
"""Largest YAML document that is read."""


def holds(*keys: str) -> AfterValidator:
    """The check that a field, a mapping, has these keys."""

    def require(given: Mapping[str, Any]) -> Mapping[str, Any]:
        if lacking := [key for key in keys if key not in given]:
            raise ValueError(f"it lacks {', '.join(lacking)}")
        return given

    return AfterValidator(require)


@dataclass(frozen=True)
class Difference:
    """The first value that differs between two documents."""

    key: str
    """Dotted."""
    before: Any
    now: Any


@dataclass(frozen=True)
class Document(Generic[_Model]):
    """The file in which a folder says what it holds, as the JSON of a pydantic model.

    `what` is what a folder with such a file is, with its article: "an evaluation". `outcome` are
    the fields that are not decided at the start; they differ from their defaults at the end.
    """

    name: str
    kind: type[_Model]
    what: str
    outcome: Collection[str] = ()

    def read(self, folder: Path) -> _Model:
        """What a folder holds.

        Raises:
            RunError: The file is missing, damaged or cannot be read.
        """
        file = folder / self.name
        try:
            return self.kind.model_validate_json(read_part(file, self.what))
        except ValidationError as error:
            raise RunError(f"{file} is damaged: {explain(error, self.kind, 'key')}") from None

    def find(self, folder: Path, leftovers: Collection[str] = ()) -> _Model | None:
        """What a folder holds; None if that is nothing but hidden files.

        Args:
            folder: The folder.
            leftovers: Names of files that a start which was killed may have left.

        Raises:
            RunError: It holds something else, or the file is damaged or cannot be read.
        """
        if (folder / self.name).exists():
            return self.read(folder)
        if other := sorted(visible_names(folder).difference(leftovers)):
            raise RunError(
                f"{folder} is not {self.what}: it has {other[0]} and no {self.name}; choose a new "
                "folder with --out"
            )
        return None

    def write(self, folder: Path, content: _Model) -> None:
        """Write what a folder holds.

        Raises:
            RunError: It cannot be written.
        """
        write_part(folder / self.name, content.model_dump_json(indent=1) + "\n")

    def begin(self, folder: Path, content: _Model, logs: Collection[str]) -> _Model:
        """Begin work in a locked folder, or continue the work that was started there.

        Work that has recorded nothing so far, such as when its model could not be reached, may be
        begun again as something else.

        Args:
            folder: The folder.
            content: What to begin or continue.
            logs: Names of the files in which the work records what it has done.

        Returns:
            What the folder now says that it holds, which may have its outcome already.

        Raises:
            RunError: The folder holds something else, or other work of this kind; or the file is
                damaged or cannot be read or written.
        """
        remove_partial_files(folder)
        recorded = self.find(folder)
        if recorded is not None:
            before, now = (self._deciding(item) for item in (recorded, content))
            different = first_difference(before, now)
            if different is None:
                return recorded
            outcome = recorded.model_dump(include=set(self.outcome), exclude_defaults=True)
            if outcome or any(_holds_bytes(folder / name) for name in logs):
                raise self.differs(folder, different)
        self.write(folder, content)
        return content

    def differs(self, folder: Path, different: Difference) -> RunError:
        """The error of work that differs from the work started in a folder."""
        return RunError(
            f"{folder} holds {self.what} with another {different.key}: {different.before}, not "
            f"{different.now}; give the same options to continue it, or choose another folder with "
            "--out"
        )

    def _deciding(self, content: _Model) -> dict[str, Any]:
        """Everything that decides the results."""
        return content.model_dump(mode="json", exclude=set(self.outcome))


def first_difference(before: Any, now: Any, place: str = "") -> Difference | None:
    """The first key whose values differ in two documents of JSON data; None if there is none.

    A missing key counts as null.
    """
    if before == now:
        return None
    if not (isinstance(before, Mapping) and isinstance(now, Mapping)):
        return Difference(place, before, now)
    found = (
        first_difference(before.get(key), now.get(key), f"{place}.{key}" if place else str(key))
        for key in {**before, **now}
    )
    return next((difference for difference in found if difference), None)


def digest_of(content: Any) -> str:
    """Hash of JSON-like data, 16 hex digits; the order of keys does not matter."""
    text = json.dumps(content, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def sealed(content: Mapping[str, Any]) -> dict[str, Any]:
    """A document with a new seal at its end, which reveals later edits."""
    plain = {key: value for key, value in content.items() if key != _SEAL}
    return {**plain, _SEAL: digest_of(plain)}


def break_seal(content: dict[str, Any]) -> bool:
    """Remove the seal of a document; whether it has one that matches."""
    return bool(content.pop(_SEAL, None) == digest_of(content))


def read_part(file: Path, what: str) -> bytes:
    """The content of a file that every folder of its kind has.

    Args:
        file: The file.
        what: What a folder with such a file is, with its article.

    Raises:
        RunError: It is missing or cannot be read.
    """
    with os_errors(f"cannot read {file}"):
        try:
            return read_regular(file)
        except FileNotFoundError:
            raise RunError(f"{file.parent} is not {what}: it has no {file.name}") from None


def write_part(file: Path, text: str) -> None:
    """Write a file of a folder that was named with --out.

    Raises:
        RunError: It cannot be written.
    """
    with out_errors(file.parent):
        write_text(file, text)


def read_object(file: Path) -> dict[str, Any]:
    """The JSON object in a file.

    Raises:
        FileNotFoundError: There is no such file.
        RunError: The file cannot be read, or holds something else.
    """
    try:
        content = parse_object(read_regular(file))
    except FileNotFoundError:
        raise
    except OSError as error:
        raise RunError(f"cannot read {file}: {error.strerror}") from None
    if content is None:
        raise RunError(f"{file} is damaged: expected a JSON object")
    return content


def read_yaml_document(
    file: Path, what: str, schema: int, expected: str = "`schema`", keys: Collection[str] = ()
) -> dict[str, Any]:
    """The YAML mapping in which a folder says what it holds.

    Args:
        file: The file.
        what: What a folder with such a file is, with its article.
        schema: The version of the folder's layout that is read.
        expected: What the mapping has, in words.
        keys: What it has besides the schema.

    Raises:
        RunError: The file is missing or damaged, or has another schema; or the folder holds links.
    """
    folder = file.parent
    if folder.is_dir():
        require_plain_files(folder)
    try:
        text = read_regular(file, _MOST_BYTES + 1)
        content = load_bounded(text.decode(), FAST_LOADER) if len(text) <= _MOST_BYTES else None
    except OSError:
        raise RunError(f"{folder} is not {what}: it has no readable {file.name}") from None
    except NOT_YAML:
        content = None
    if not isinstance(content, dict) or not {"schema", *keys} <= content.keys():
        raise RunError(f"{file} is damaged: expected a mapping with {expected}")
    require_schema(folder, content, schema)
    return content


def require_schema(
    place: Path, content: Mapping[str, Any], schema: int, otherwise: str = ""
) -> None:
    """Refuse a document of another version; `otherwise` says what else can be done.

    Raises:
        RunError: It is of another version.
    """
    if content["schema"] != schema:
        raise RunError(
            f"{place} has schema {content['schema']!r}, but this version reads only schema "
            f"{schema}: use the agentflow version that wrote it{otherwise}"
        )


def _holds_bytes(file: Path) -> bool:
    return file.exists() and bool(file.stat().st_size)

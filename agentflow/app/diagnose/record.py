"""The directory of a diagnosis: continued after a kill, as every call is on record.

diagnosis.json   what is asked of which model; the marked answers and results, once it is finished
calls.jsonl      every call of the model
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel

from agentflow.app.about import read_about, require_empty, require_same, write_about
from agentflow.app.diagnose.question import Mark
from agentflow.files import cannot_write, hold_folder, remove_partial_files
from agentflow.llm.messages import Sampling

ABOUT, CALLS = "diagnosis.json", "calls.jsonl"
WHAT = "a diagnosis"
OUTCOME = {"answers", "results"}


class Diagnosis(BaseModel, frozen=True, extra="forbid"):
    """The content of diagnosis.json: everything that decides the results, and the results."""

    format: Literal[1] = 1
    """Version of the directory's layout."""
    diagnostic: str
    model: str
    """The model's name in results."""
    seed: int
    """Of the questions, and of the simulations."""
    size: int
    """Overlapping pairs in all, or questions."""
    asked: str
    """Content hash of the questions: results of models that were asked the same can be compared."""
    sampling: Sampling
    prompts: str
    """Prompt set with the digest of its questions."""
    conditions: Mapping[str, str]
    """Constants, blocks and physics engine."""
    answers: tuple[Mark, ...] = ()
    results: Mapping[str, Any] | None = None
    """None until the diagnosis is finished."""


@contextmanager
def open_diagnosis(path: Path, about: Diagnosis) -> Iterator[Diagnosis]:
    """Begin a diagnosis in a new or empty folder, or continue the one that is there.

    One without any reply, such as of a model that could not be reached, is begun again.

    Raises:
        RunError: The folder holds something else, or another diagnosis; it is damaged, in use by
            another process, or cannot be written.
    """
    with hold_folder(path):
        remove_partial_files(path)
        if (path / ABOUT).exists():
            about = _continue(path, about)
        else:
            require_empty(path / ABOUT, WHAT)
        if about.results is None:
            write_diagnosis(path, about)
        yield about


def write_diagnosis(path: Path, about: Diagnosis) -> None:
    """Write diagnosis.json.

    Raises:
        RunError: It cannot be written.
    """
    try:
        write_about(path / ABOUT, about)
    except OSError as error:
        raise cannot_write(path, error) from None


def _continue(path: Path, about: Diagnosis) -> Diagnosis:
    """The recorded diagnosis, which must be the same; a new one if that has no replies."""
    recorded = read_about(path / ABOUT, Diagnosis, WHAT)
    before, now = (item.model_dump(mode="json", exclude=OUTCOME) for item in (recorded, about))
    calls = path / CALLS
    if recorded.results is not None or (calls.exists() and calls.stat().st_size):
        require_same(path, WHAT, before, now)
    return recorded if before == now else about

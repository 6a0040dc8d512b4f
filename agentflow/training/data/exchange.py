"""Sets made from elsewhere: conversations, machines with captions; prompts for other trainers."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import cycle, islice
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from agentflow.agents.base import chat_prompt
from agentflow.agents.designer import Designer
from agentflow.diversity.topology import tree_hash
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from agentflow.files.atomic import os_errors, write_output
from agentflow.files.folders import hold_new_folder
from agentflow.machine import Report, check, library
from agentflow.machine.brief import Brief, Limits
from agentflow.machine.formats.detect import read_any, read_text
from agentflow.models.local.libraries import require_libraries
from agentflow.training.data.card import DataCard, make_card, write_set
from agentflow.training.data.contamination import compare_texts, evaluation_trees
from agentflow.training.data.gates import Gate, Judgement
from agentflow.training.data.generate import split_reply
from agentflow.training.data.pairs import ChatMessage, Pair, clean_text, make_pair, make_prompt

DATA_SOURCE = "agentflow"
"""By it, verl groups its metrics and chooses its reward function."""


def prompt_rows(tasks: Sequence[str], count: int, engine: str) -> list[dict[str, Any]]:
    """Rows for the rewards in `integrations`, alternating between tasks, each with its own seed.

    `task` and `seed` are for TRL, the rest but `prompt` is for verl.

    Raises:
        UsageError: A task or the engine does not exist, or there is no task.
    """
    if not tasks:
        raise UsageError("name at least one task, as in --tasks throwing,movement/3")
    prompts = {task: chat_prompt(Designer, get_task(task, engine=engine).brief) for task in tasks}
    return [
        {
            "data_source": DATA_SOURCE,
            "prompt": prompts[task],
            "ability": "design",
            "reward_model": {"style": "rule", "ground_truth": task},
            "extra_info": {"index": index, "seed": index, "knobs": "{}"},
            "task": task,
            "seed": index,
        }
        for index, task in enumerate(islice(cycle(tasks), count))
    ]


def write_prompts(out: Path, tasks: Sequence[str], count: int, engine: str) -> dict[str, Any]:
    """Write the rows to a parquet file; `out` and the number of `rows`.

    Raises:
        UsageError: As `prompt_rows` does, or the file cannot be written.
        ConfigError: The library datasets is not installed.
    """
    rows = prompt_rows(tasks, count, engine)
    require_libraries("datasets")
    from datasets import Dataset

    with write_output(out) as part:
        Dataset.from_list(rows).to_parquet(part)
    return {"out": str(out), "rows": len(rows)}


COMMAND = "agentflow data import"
ROLES = {"human": "user", "gpt": "assistant", "bot": "assistant"}
"""Names of roles in older chat formats."""
KIND = "import"


@dataclass(frozen=True)
class ImportedPair:
    """A prompt and a reply from elsewhere."""

    name: str
    """Of the objective: rows with the same prompt have the same one."""
    text: str
    prompt: tuple[ChatMessage, ...]
    rationale: str
    report: Report
    reply: str | None
    """As it was written; None to write it from rationale and machine."""
    source: str


def import_set(
    source: Path, out: Path, *, evaluation: Sequence[Path] = (), licence: str | None = None
) -> DataCard:
    """Write a set of what a file or folder holds, with its card; machines are not simulated.

    Args:
        source: JSON or JSONL file of conversations, or folder of .bsg files with captions.
        out: Folder of the set: new or empty.
        evaluation: Runs and evaluations whose machines must not be in the set.
        licence: Of the set.

    Raises:
        UsageError: The source cannot be read, or holds nothing to import.
        RunError: `out` is not empty, or cannot be written.
    """
    rows = list(_read_folder(source) if source.is_dir() else _read_file(source))
    if not rows:
        raise UsageError(f"{source} holds nothing to import")
    trees = evaluation_trees(evaluation)
    likenesses = compare_texts({_name_of(row.text): row.text for row in rows})
    with hold_new_folder(out):
        judged, pairs, kept = [], [], set[str]()
        for number, row in enumerate(rows):
            contaminated = likenesses[_name_of(row.text)].contaminated
            judgement = _judge(row, number, contaminated, trees, kept)
            judged.append(judgement)
            if judgement.dropped is None:
                kept.add(judgement.tree)
                pairs.append(_pair(row))
        card = make_card(
            pairs,
            judged,
            dict.fromkeys((row.name for row in rows), KIND),
            model="; ".join(sorted({row.source for row in rows})),
            made_with=COMMAND,
            licence=licence or "not stated; see where the data come from",
            engine=None,
            planned=len(rows),
            seed=0,
            likenesses=likenesses,
        )
        write_set(out, pairs, card)
        return card


def _judge(
    row: ImportedPair, number: int, contaminated: bool, trees: frozenset[str], kept: set[str]
) -> Judgement:
    machine, problems = row.report.machine, row.report.problems
    tree = tree_hash(machine) if machine else ""
    gates: Iterable[tuple[Gate, bool]] = (
        ("objective", contaminated),
        ("parse", machine is None),
        ("validity", not row.report.machine_valid),
        ("evaluation", tree in trees),
        ("duplicate", tree in kept),
    )
    dropped = next((gate for gate, drops in gates if drops), None)
    why = problems[0].code if dropped in ("parse", "validity") and problems else ""
    return Judgement(
        objective=row.name, sample=number, source=row.source, dropped=dropped, why=why, tree=tree
    )


def _pair(row: ImportedPair) -> Pair:
    machine = row.report.machine
    assert machine is not None, "it passed its gates"
    return make_pair(
        row.prompt,
        row.rationale,
        machine,
        row.reply,
        objective=row.name,
        score=None,
        source=row.source,
    )


def _read_file(path: Path) -> Iterator[ImportedPair]:
    """The conversations in a JSON list or JSONL file."""
    for number, row in _rows(_whole_text(path), path):
        yield _conversation(row, f"{path}, {number}", f"imported from {path.name}")


def _whole_text(path: Path) -> str:
    """The text of a file, which may be as large as memory allows."""
    if path.exists() and not path.is_file():
        raise UsageError(f"{path} is neither a file nor a folder")
    try:
        with os_errors(f"cannot read {path}", UsageError):
            return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise UsageError(f"{path} is not UTF-8 text") from None


def _rows(text: str, path: Path) -> Iterator[tuple[str, Any]]:
    """Each row with its place."""
    if text.lstrip().startswith("["):
        try:
            items = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise UsageError(f"{path} is not JSON: {error}") from None
        yield from ((f"item {number}", item) for number, item in enumerate(items, start=1))
        return
    for number, line in enumerate(text.split("\n"), start=1):
        if line.strip():
            try:
                yield f"line {number}", json.loads(line)
            except (ValueError, RecursionError) as error:
                raise UsageError(f"{path}, line {number} is not JSON: {error}") from None


def _conversation(row: Any, where: str, source: str) -> ImportedPair:
    """A row of a chat data set.

    Raises:
        UsageError: It is not a prompt followed by one reply.
    """
    given = row.get("messages", row.get("conversations")) if isinstance(row, Mapping) else row
    try:
        *prompt, reply = [_message(item) for item in given]
        if not prompt or reply.role != "assistant" or any(m.role == "assistant" for m in prompt):
            raise ValueError
    except (TypeError, ValueError, AttributeError, ValidationError):
        raise UsageError(
            f'{where}: expected {{"messages": [...]}} with messages of system and user, then one '
            'of assistant, each {"role": ..., "content": ...}'
        ) from None
    fields = row if isinstance(row, Mapping) else {}
    text = "\n".join(message.content for message in prompt)
    rationale, program = split_reply(reply.content)
    return ImportedPair(
        name=str(fields.get("objective") or _name_of(text)),
        text=text,
        prompt=tuple(prompt),
        rationale=clean_text(rationale),
        report=_checked(program),
        reply=reply.content,
        source=str(fields.get("source") or source),
    )


def _message(item: Any) -> ChatMessage:
    """A message with `role` and `content`, or with `from` and `value`."""
    role, content = item.get("role", item.get("from")), item.get("content", item.get("value"))
    cleaned = clean_text(content) if isinstance(content, str) else content
    return ChatMessage.model_validate({"role": ROLES.get(role, role), "content": cleaned})


def _read_folder(folder: Path) -> Iterator[ImportedPair]:
    """The .bsg files of a folder that have a caption."""
    for path in sorted(folder.rglob("*.bsg")):
        caption = path.with_suffix(".txt")
        if not caption.is_file():
            raise UsageError(f"{path} has no caption: write what it is in {caption.name}")
        text = " ".join(clean_text(read_text(str(caption))).split())
        if not text:
            raise UsageError(f"{caption} is empty: write what the machine is")
        report = _checked(read_text(str(path)), bsg=True)
        yield ImportedPair(
            name=_name_of(text),
            text=text,
            prompt=_prompt_for(text, report),
            rationale="",
            report=report,
            reply=None,
            source=f"imported from {folder.name}",
        )


def _prompt_for(text: str, report: Report) -> tuple[ChatMessage, ...]:
    """The prompt of a designer for a caption, with the core blocks and those of the machine."""
    used = {step.type for step in report.machine or ()}
    blocks = tuple(sorted({*library().core, *used}))
    brief = Brief("free design", text, (), (), (), blocks)
    return make_prompt(chat_prompt(Designer, brief))


def _checked(source: str, bsg: bool = False) -> Report:
    blocks = tuple(library())
    reading = read_any(source, "bsg" if bsg else "tree", blocks)
    return check(reading, limits=Limits())


def _name_of(text: str) -> str:
    """A short name of a text, the same for equal texts."""
    return f"text-{sha256(text.encode()).hexdigest()[:12]}"

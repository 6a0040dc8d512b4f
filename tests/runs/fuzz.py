"""Damaged and forged files of every kind, and what everything that reads them does with them."""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import shutil
import signal
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from agentflow.errors import AgentflowError
from agentflow.files.documents import sealed
from agentflow.files.yaml import FAST_LOADER
from tests.runs.sources import InProcess, Reader, Source

VALUES: tuple[Any, ...] = (
    *(None, True, False, -1, 0, 1, 2, 0.5, -7.25, float("nan"), float("inf"), 10**30, 10**400),
    *("", "x", "1", "movement", "../../own.txt", "/dev/zero", "\x1b[31mred\x07", "\ud800", "ok"),
    *([], {}, [None], [[]], {"x": 1}, [1, 2], ["a"], {"": None}),
)
SAFE: tuple[Any, ...] = (
    *(None, True, -1, 0, 1, 2, 0.5, "", "x", "\x1b[31m", [], {}, [None], {"x": 1}, "movement/2"),
)
"""Values for YAML: huge numbers there are long runs, not damage."""
MOST_SECONDS = 120
"""Longest time of a reader, which most need less than a second for."""
READERS = 2
"""Readers that a mutation is shown to, drawn at random."""
Mutation = Callable[[Path, random.Random], None]
Outcome = tuple[int, str, str, str]
"""(number, mutations, reader, "ok", "refused" or a fault) of a mutated copy."""


def _paths(item: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    pairs: Iterable[tuple[Any, Any]] = ()
    if isinstance(item, dict | list):
        pairs = item.items() if isinstance(item, dict) else enumerate(item)
    for key, value in pairs:
        yield (*at, key)
        yield from _paths(value, (*at, key))


def _place(document: Any, path: tuple[Any, ...]) -> tuple[Any, Any]:
    *above, last = path
    for key in above:
        document = document[key]
    return document, last


def _change_value(document: Any, values: tuple[Any, ...], rng: random.Random) -> None:
    """Replace or remove one value of JSON data, anywhere in it, or copy another one there."""
    paths = list(_paths(document))
    group, last = _place(document, rng.choice(paths))
    change = rng.random()
    if change < 0.2:
        del group[last]
    elif change < 0.3:
        other, key = _place(document, rng.choice(paths))
        group[last] = json.loads(json.dumps(other[key], default=str))
    else:
        group[last] = rng.choice(values)


def change_value(file: Path, rng: random.Random) -> None:
    """Change a value of JSON lines, JSON or YAML, of which a seal then fits."""
    in_yaml = file.suffix == ".yaml"
    lines = file.read_text().splitlines() if file.suffix == ".jsonl" else [file.read_text()]
    number = rng.randrange(len(lines))
    item = yaml.load(lines[number], FAST_LOADER) if in_yaml else json.loads(lines[number])
    was_sealed = isinstance(item, dict) and "seal" in item
    _change_value(item, SAFE if in_yaml else VALUES, rng)
    item = sealed(item) if was_sealed else item
    lines[number] = yaml.safe_dump(item, sort_keys=False) if in_yaml else json.dumps(item)
    file.write_text("\n".join(lines) + "\n")


def change_lines(file: Path, rng: random.Random) -> None:
    """Drop, repeat or swap lines."""
    lines = file.read_bytes().splitlines(keepends=True)
    one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    change = rng.randrange(3)
    if change == 0:
        del lines[one]
    elif change == 1:
        lines.insert(other, lines[one])
    else:
        lines[one], lines[other] = lines[other], lines[one]
    file.write_bytes(b"".join(lines))


def change_bytes(file: Path, rng: random.Random) -> None:
    """Cut a file off, or overwrite some of its bytes."""
    content = bytearray(file.read_bytes())
    at = rng.randrange(len(content) + 1)
    if rng.random() < 0.5:
        del content[at:]
    else:
        content[at : at + 4] = rng.choice((b"\0\0\0\0", b"\xff\xfe", b'"', b"{", b"\x1b[0m", b""))
    file.write_bytes(content)


def change_depth(file: Path, rng: random.Random) -> None:
    """Put groups inside each other in place of a line, deeper than a stack can hold."""
    lines = file.read_bytes().splitlines(keepends=True)
    deep = rng.choice((b"[", b'{"a":', b"- ", b"<a>")) * 100_000
    lines[rng.randrange(len(lines))] = deep + b"\n"
    file.write_bytes(b"".join(lines))


def change_files(file: Path, rng: random.Random) -> None:
    """Remove a file, or put a folder, a pipe or a link to a file outside in its place."""
    own = next(above / "own.txt" for above in file.parents if (above / "own.txt").is_file())
    file.unlink()
    if (change := rng.randrange(4)) == 1:
        file.mkdir()
    elif change == 2:
        file.symlink_to(own)
    elif change == 3 and not NAMED.intersection((file.name, file.parent.name)):
        os.mkfifo(file)


NAMED = {"copy", "set", "card.json"}
"""Names of files, or of their folder, that users name: a pipe there is no damage."""
MUTATIONS: tuple[Mutation, ...] = (
    *(change_value,) * 8,
    *(change_lines, change_bytes, change_depth, change_files),
)


def _outcome(read: Reader) -> str:
    """What a reader did: "ok", "refused", or the traceback or output that it should not have."""
    out, err = io.StringIO(), io.StringIO()
    signal.alarm(MOST_SECONDS)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = read()
    except AgentflowError as error:
        return "refused" if "\n" not in str(error) else f"several lines: {error}"
    except (Exception, _TooSlow):  # noqa: BLE001 - this is what is looked for
        return traceback.format_exc()
    finally:
        signal.alarm(0)
    shown = out.getvalue() + err.getvalue()
    if "Traceback" in shown:
        return shown
    if "\x1b" in shown or "\x07" in shown:
        return f"control characters: {shown!r}"
    if status == 2 and err.getvalue().count("\n") != 1:
        return f"several lines: {err.getvalue()}"
    return "refused" if status == 2 else "ok"


class _TooSlow(BaseException):
    """A reader has not ended in time; no reader may handle it."""


def _too_slow(*_: object) -> None:
    raise _TooSlow(f"it has not ended after {MOST_SECONDS} s")


FAULTS = (OSError, ValueError, LookupError, TypeError, RecursionError)
"""What a mutation raises where an earlier one has left nothing that it can change."""


def outcomes(
    sources: Mapping[str, Source], folder: Path, numbers: Iterable[int], seed: int
) -> Iterator[Outcome]:
    """Show mutated copies of the sources to their readers; "written outside" is a fault.

    Args:
        sources: Name -> source, each in a folder of its own.
        folder: An empty folder, for the copies.
        numbers: Which mutations; each is drawn from the seed and its number.
        seed: Of the mutations.
    """
    pool = InProcess()
    own = folder / "own.txt"
    own.write_text("own\n")
    signal.signal(signal.SIGALRM, _too_slow)
    for number in numbers:
        rng = random.Random(f"{seed} {number}")
        name = rng.choice(list(sources))
        copy = shutil.copytree(sources[name].folder, folder / "copy")
        files = sorted(path for path in copy.rglob("*") if path.is_file() and path.name != "lock")
        if rng.random() < 0.3 and (results := [f for f in files if f.name == "result.json"]):
            results[0].unlink()
            files.remove(results[0])
        changed, places = [f"{number}: {name}"], set[str]()
        for mutate in rng.choices(MUTATIONS, k=rng.choice((1, 1, 2, 3))):
            kind = rng.choice(sorted({(path.parent, path.suffix) for path in files}))
            file = rng.choice([path for path in files if (path.parent, path.suffix) == kind])
            with contextlib.suppress(*FAULTS, yaml.YAMLError):
                if file.is_file() and not file.is_symlink():
                    mutate(file, rng)
                    changed.append(f"{mutate.__name__} {file.relative_to(copy)}")
                    places |= {*file.relative_to(copy).parts} - {"runs"}
        (folder / "out").mkdir()
        readers = sources[name].readers(copy, pool)
        fitting = [each for each in readers if any(place in each for place in places)]
        fitting = fitting or list(readers)
        for reader in sorted(rng.sample(fitting, min(READERS, len(fitting)))):
            yield number, "; ".join(changed), f"{name}: {reader}", _outcome(readers[reader])
        shutil.rmtree(copy)
        shutil.rmtree(folder / "out")
        if own.read_text() != "own\n" or sorted(p.name for p in folder.iterdir()) != ["own.txt"]:
            yield number, "; ".join(changed), "all", f"written outside: {sorted(folder.iterdir())}"


def summary(found: Iterable[Outcome]) -> tuple[Counter[str], list[tuple[int, str]]]:
    """Numbers of outcomes by source and reader, and the faults with the numbers of mutations."""
    counts: Counter[str] = Counter()
    faults = []
    for number, changed, reader, outcome in found:
        kind = outcome if outcome in ("ok", "refused") else "fault"
        counts[f"{reader}: {kind}"] += 1
        if kind == "fault":
            faults.append((number, f"{changed}: {reader}: {outcome}"))
    return counts, faults

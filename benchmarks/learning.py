"""Writes the tables and pictures of docs/results/learning.md from the folders of `scripts/learn`.

Measures nothing itself; `scripts/learn` runs all stages first.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from html import escape
from math import ceil, floor, log10
from pathlib import Path
from statistics import fmean
from typing import Any

from agentflow.metrics.tables import Column, Row, Table, markdown
from agentflow.training.evaluation.record import Collection, collect
from agentflow.training.evaluation.tables import best_table, uncertainty_table
from agentflow.training.record import TrainingRecord

BEGIN, END = "<!-- made by benchmarks/learning.py: do not edit -->", "<!-- end of what it made -->"
START, IMPROVED, SEEDS, TASK = "sft", "pass1", (0, 1), "throwing"
"""Folders without their seed, the seeds, and the task that GRPO learns."""
CURVES = {
    "valid": "share of valid replies",
    "score": "mean score of a step",
    "score_max": "greatest score of a step",
    "entropy": "entropy per token (nats)",
}
"""Number in the curves of GRPO -> title of its picture."""
SPENT = {
    "seconds_generation": "generation",
    "seconds_simulation": "waiting for simulations",
    "seconds_update": "update",
}
COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#7f7f7f", "#17becf")
WIDTH, HEIGHT, LEFT, BOTTOM, TOP = 640, 300, 56, 36, 30


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("learning"))
    parser.add_argument("--page", type=Path, default=Path("docs/results/learning.md"))
    parser.add_argument("--pictures", type=Path, default=Path("docs/pictures/learning"))
    given = parser.parse_args()
    pictures = given.pictures
    pictures.mkdir(parents=True, exist_ok=True)
    found = collect([given.folder])
    tables = [
        funnel(given.folder / "set" / "card.json"),
        claims(found),
        uncertainty_table(found, with_published=True),
        best_of_evaluations(found),
        diversity(found),
        times(given.folder, found),
    ]
    parts = [*map(markdown, tables), *curves(found, pictures, given.page.parent)]
    write(given.page, "\n".join(parts))
    print(f"{given.page}: results of {given.folder}")


def write(page: Path, made: str, begin: str = BEGIN) -> None:
    """Put the results between the marks of the page, or into a page of their own."""
    text = page.read_text(encoding="utf-8") if page.exists() else f"{begin}\n{END}\n"
    before, _, rest = text.partition(begin)
    after = rest.partition(END)[2]
    page.write_text(f"{before}{begin}\n\n{made}\n{END}{after}", encoding="utf-8")


def funnel(card_file: Path) -> Table:
    """What each gate of the filter let through."""
    card = json.loads(card_file.read_text(encoding="utf-8"))
    published, pairs = card["published"], card["pairs"]
    every = f"answers of {card['model']}, and their variants"
    rows = [Row(("all", every), (card["answers"] + card["variants"],))]
    rows += [Row((gate["gate"], gate["passes"]), (gate["passed"],)) for gate in card["gates"]]
    notes = (
        f"{pairs['train']} pairs to train and {pairs['dev']} to measure. "
        f"Published: {published['answers']} answers, {published['pairs']} pairs.",
    )
    columns = (Column("", "machines"),)
    return Table("Data", ("gate", "passes if"), columns, tuple(rows), notes=notes)


def claims(found: Collection) -> Table:
    """What was expected of a cold start and of GRPO, and what each seed shows."""
    rows = [row for seed in SEEDS for row in _claims_of(found, seed)]
    columns = (Column("", "before"), Column("", "after"), Column("", "held"))
    title = f"Expected and measured on {TASK}, on fresh samples, with 95 % intervals"
    return Table(title, ("seed", "expected"), columns, tuple(rows))


def _claims_of(found: Collection, seed: int) -> Iterator[Row]:
    before, after = _single(found, START, seed), _single(found, IMPROVED, seed)
    if before is None or after is None:
        return
    (low, high), (later_low, later_high) = before["valid"]["interval"], after["valid"]["interval"]
    (mean_low, mean_high), (least, most) = before["mean_interval"], after["mean_interval"]
    claims = (
        ("cold start: at least 60 % valid", None, _valid(before), (low - 0.6, high - 0.6)),
        (
            "pass1: at least 8 points more",
            _valid(before),
            _valid(after),
            (later_low - high - 0.08, later_high - low - 0.08),
        ),
        (
            "pass1: 1.25 times the mean",
            _mean(before),
            _mean(after),
            (least - 1.25 * mean_high, most - 1.25 * mean_low),
        ),
    )
    for claim, first, last, margin in claims:
        yield Row((str(seed), claim), (first, last, _held(*margin)))


def _held(low: float, high: float) -> str:
    """What an interval of a margin says; that of a difference is from both ends, so careful."""
    return "yes" if low >= 0 else "no" if high < 0 else "unclear"


def _valid(numbers: Mapping[str, Any]) -> str:
    low, high = numbers["valid"]["interval"]
    return f"{numbers['valid']['share']:.0%} ({low:.0%} to {high:.0%})"


def _mean(numbers: Mapping[str, Any]) -> str:
    low, high = numbers["mean_interval"]
    return f"{numbers['mean']:.2f} ({low:.2f} to {high:.2f})"


def _single(found: Collection, name: str, seed: int) -> Mapping[str, Any] | None:
    """The numbers of one evaluation, whose folder names its seed."""
    members = [
        member for pool in found.evaluations if pool.name == name for member in pool.members.items()
    ]
    results = [about.results for path, about in members if path.name.startswith(f"{name}-{seed}.")]
    return results[0][TASK] if results and results[0] else None


def best_of_evaluations(found: Collection) -> Table:
    """Best@N without the rows of steps, which the pictures show."""
    table = best_table(found)
    return replace(table, rows=tuple(row for row in table.rows if row.labels[-1] == "-"))


def by_name(found: Collection) -> dict[str, list[TrainingRecord]]:
    """Name of a kind of GRPO -> its training runs, one for each seed."""
    runs: dict[str, list[TrainingRecord]] = {}
    for name, record in found.trainings.items():
        if record.about.kind == "grpo":
            runs.setdefault(name.rpartition("-")[0], []).append(record)
    return runs


def diversity(found: Collection) -> Table:
    """How different the valid machines of 64 samples are before and after GRPO."""
    names = dict.fromkeys(key for row in _evaluations(found) for key in row[3] if key != "machines")
    rows = [
        Row((name, str(seed), str(step)), tuple(map(measures.get, ("machines", *names))))
        for name, seed, step, measures in _evaluations(found)
    ]
    columns = tuple(Column("", name.replace("_", " ")) for name in ("machines", *names))
    return Table("Diversity by step of GRPO", ("run", "seed", "step"), columns, tuple(rows))


def _evaluations(found: Collection) -> Iterator[tuple[str, int, int, Mapping[str, Any]]]:
    """The diversity of the first and of the last evaluation of each run."""
    for name, records in by_name(found).items():
        for record in records:
            rows = [row for row in record.curves if "eval" in row]
            for row in rows[:: max(1, len(rows) - 1)]:
                yield name, record.config["seed"], row["step"], row["eval"][TASK]["diversity"]


def times(folder: Path, found: Collection) -> Table:
    """How long each stage took, and on what GRPO spent its steps."""
    rows = []
    for file in sorted(folder.glob("*.seconds"), key=lambda path: path.stat().st_mtime):
        record = found.trainings.get(file.stem)
        spent = [_total(record, number) for number in SPENT] if record else []
        shares = [f"{part / sum(spent):.0%}" if sum(spent) else None for part in spent]
        rows.append(Row((file.stem,), (int(file.read_text()), *(shares or [None] * len(SPENT)))))
    columns = (Column("", "seconds"), *(Column("", name) for name in SPENT.values()))
    notes = ("Stages of two seeds ran side by side on two cores, with a thread each.",)
    return Table("Time of each stage", ("stage",), columns, tuple(rows), notes=notes)


def _total(record: TrainingRecord, number: str) -> float:
    return sum(float(row.get(number) or 0) for row in record.curves)


def curves(found: Collection, pictures: Path, base: Path) -> list[str]:
    """A picture for each number: one line for each kind of GRPO, the mean of its seeds.

    Trainings without a cold start are left out: their scores stay 0, and their entropy is so high
    that the others could not be distinguished.
    """
    runs = by_name(found).items()
    learned = {name: records for name, records in runs if not records[0].config["fresh"]}
    parts = []
    for number, title in CURVES.items():
        lines = {name: _line(records, number) for name, records in learned.items()}
        if any(lines.values()):
            file = pictures / f"{number.replace('_', '-')}.svg"
            file.write_text(chart(title, lines), encoding="utf-8")
            parts.append(f"![{title}, by step of GRPO on {TASK}]({os.path.relpath(file, base)})\n")
    return parts


def _line(records: Sequence[TrainingRecord], number: str) -> list[tuple[int, float]]:
    values: dict[int, list[float]] = {}
    for row in (row for record in records for row in record.curves):
        if row.get(number) is not None:
            values.setdefault(row["step"], []).append(float(row[number]))
    return [(step, fmean(found)) for step, found in sorted(values.items())]


def round_ticks(top: float, least: float = 0.0) -> list[float]:
    """About five round numbers from 0 to `top` or a little more, at least `least` apart."""
    raw = max(top / 5, least)
    power = 10.0 ** floor(log10(raw))
    size = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= 0.999 * raw)
    return [number * size for number in range(ceil(0.999 * top / size) + 1)]


def chart(title: str, lines: Mapping[str, Sequence[tuple[int, float]]]) -> str:
    """A line chart as SVG."""
    last = max(step for points in lines.values() for step, _ in points) or 1
    rows = round_ticks(max(value for points in lines.values() for _, value in points) or 1.0)
    top = rows[-1]
    wide, high = WIDTH - LEFT - 10, HEIGHT - BOTTOM - TOP

    def place(step: float, value: float) -> str:
        return f"{LEFT + wide * step / last:.1f},{TOP + high * (1 - value / top):.1f}"

    legend = HEIGHT + 18 * len(lines)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {legend}" width="{WIDTH}" '
        'font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="white"/>',
        f'<text x="{LEFT}" y="18" font-size="14">{escape(title)}</text>',
    ]
    for value in rows:
        y = TOP + high * (1 - value / top)
        parts.append(f'<path d="M{LEFT} {y:.1f}h{wide}" stroke="#ddd"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{value:.3g}</text>')
    for step in (step for step in round_ticks(last, least=1) if step <= last):
        x = LEFT + wide * step / last
        parts.append(f'<text x="{x:.1f}" y="{HEIGHT - 14}" text-anchor="middle">{step:.0f}</text>')
    for number, (name, points) in enumerate(lines.items()):
        colour, y = COLOURS[number % len(COLOURS)], HEIGHT + 18 * number
        path = " ".join(place(step, value) for step, value in points)
        parts.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>')
        parts.append(f'<path d="M{LEFT} {y}h24" stroke="{colour}" stroke-width="3"/>')
        parts.append(f'<text x="{LEFT + 30}" y="{y + 4}">{escape(name)}</text>')
    return "\n".join([*parts, "</svg>"]) + "\n"


if __name__ == "__main__":
    main()

"""Writes a set: its pairs in two files, and its card for programs and for people."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from agentflow.files import write_output
from agentflow.llm.messages import CHARS_PER_TOKEN
from agentflow.training.data.card import Card
from agentflow.training.data.contamination import MOST_SHARED, MOST_SIMILAR, WORDS
from agentflow.training.data.pairs import DEV, TRAIN, Pair, write_pairs

CARD, CARD_TEXT = "card.json", "card.md"


def write_set(folder: Path, pairs: Sequence[Pair], card: Card) -> None:
    """Write train.jsonl, dev.jsonl and the card.

    Raises:
        UsageError: A file cannot be written.
    """
    apart = {item.name for item in card.objectives if item.split == "dev"}
    write_pairs(folder / TRAIN, (pair for pair in pairs if pair.objective not in apart))
    write_pairs(folder / DEV, (pair for pair in pairs if pair.objective in apart))
    for name, text in (
        (CARD_TEXT, card_text(card)),
        (CARD, json.dumps(card.model_dump(mode="json"), indent=1) + "\n"),
    ):
        with write_output(folder / name) as part:
            part.write_text(text, encoding="utf-8", newline="\n")


def card_text(card: Card) -> str:
    """The card for people, in Markdown."""
    parts = {
        "Data card": _facts(card),
        "Gates": _gates(card),
        "Sources": _table(("source", "pairs"), list(card.sources.items())),
        "Lengths": _lengths(card),
        "Contamination": _contamination(card),
        "Objectives": _table(
            ("objective", "kind", "file", "machines", "pairs"),
            [(i.name, i.kind, i.split, i.machines, i.pairs) for i in card.objectives],
        ),
    }
    headed = ("\n".join([f"## {title}", "", *lines]) for title, lines in parts.items())
    return "\n\n".join(headed).removeprefix("#") + "\n"


def _facts(card: Card) -> list[str]:
    return [
        f"* Machines designed by: {card.model}",
        f"* Recorded with: `{card.made_with}`",
        f"* Licence: {card.licence}",
        f"* Physics engine: {card.engine or 'none; the machines were not simulated'}",
        f"* Answers: {card.answers} of {card.planned} planned; variants made by random edits: "
        f"{card.variants}",
        f"* Pairs: {card.pairs['train']} in {TRAIN}, {card.pairs['dev']} in {DEV}; no objective is "
        "in both",
        f"* Simulations that timed out or crashed, dropped: {card.faults}",
    ]


def _gates(card: Card) -> list[str]:
    published, total = card.published, sum(card.pairs.values())
    return [
        "In the order in which they were applied: those that need no simulation come first.",
        "",
        *_table(
            ("gate", "passes if", "machines before", "after"),
            [(item.gate, item.passes, item.entered, item.passed) for item in card.gates],
        ),
        "",
        f"The published data: {published['objectives']} objectives x {published['samples']} "
        f"replies = {published['answers']:,}, of which {published['pairs']:,} pairs "
        f"({published['pairs'] / published['answers']:.0%}) passed. Here: {len(card.objectives)} "
        f"objectives, {card.answers:,} answers and {card.variants:,} variants, {total:,} pairs "
        f"({total / max(1, card.answers + card.variants):.0%}).",
    ]


def _lengths(card: Card) -> list[str]:
    return [
        f"In tokens, estimated from {CHARS_PER_TOKEN} characters a token.",
        "",
        *_table(
            ("text", "mean", "median", "greatest"),
            [(name, item.mean, item.median, item.most) for name, item in card.tokens.items()],
        ),
    ]


def _contamination(card: Card) -> list[str]:
    return [
        f"An objective is left out if {MOST_SHARED:.0%} or more of its runs of {WORDS} words are "
        f"in the brief of a level, if {MOST_SHARED:.0%} or more of those of a level's objective "
        "are in its text, or if its TF-IDF cosine with a sentence of a brief is "
        f"{MOST_SIMILAR:g} or more. The texts that come nearest:",
        "",
        *_table(("text", "level", "shared", "cosine"), _nearest(card)),
        "",
        "A machine is left out if it is the same tree of block types as one of an evaluation or as "
        "the best known machine of a level.",
    ]


def _nearest(card: Card) -> list[tuple[object, ...]]:
    """The ten texts that come nearest to a level."""
    texts = card.contamination["texts"].items()
    ranked = sorted(texts, key=lambda item: -max(item[1]["shared"], item[1]["cosine"]))
    return [
        (name, found["level"], f"{found['shared']:.2f}", f"{found['cosine']:.2f}")
        for name, found in ranked[:10]
    ]


def _table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> list[str]:
    cells = [[str(cell).replace("|", "\\|").replace("\n", " ") for cell in row] for row in rows]
    lines = [head, ["---"] * len(head), *cells]
    return [f"| {' | '.join(line)} |" for line in lines]

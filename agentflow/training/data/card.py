"""The card of a set: where its pairs come from, and what each gate left out; writes both."""

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from random import Random
from statistics import fmean, median
from typing import Any, Literal

import yaml
from pydantic import BaseModel

from agentflow.files.atomic import write_file
from agentflow.files.templates import fill
from agentflow.llm.messages import CHARS_PER_TOKEN, estimate_tokens
from agentflow.training.data.contamination import MOST_SHARED, MOST_SIMILAR, WORDS, Likeness
from agentflow.training.data.gates import GATES, Judgement
from agentflow.training.data.pairs import DEV, TRAIN, Pair, write_pairs

DEV_SHARE = 0.1
"""Share of the objectives whose pairs are kept apart, for measuring."""
PUBLISHED: Mapping[str, int] = {
    "objectives": 100,
    "samples": 250,
    "answers": 25_000,
    "pairs": 9_982,
}
"""The funnel of the published data: replies to each objective, and pairs after all filters. From
section 5 of arXiv:2510.14980."""


class GateCount(BaseModel, frozen=True, extra="forbid"):
    """How many machines one gate let through."""

    gate: str
    passes: str
    entered: int
    passed: int


class ObjectiveCount(BaseModel, frozen=True, extra="forbid"):
    """How many machines for one objective are in the set."""

    name: str
    kind: str
    split: Literal["train", "dev"]
    machines: int
    """Before the gates."""
    pairs: int


class Lengths(BaseModel, frozen=True, extra="forbid"):
    """Lengths in tokens, estimated."""

    mean: float
    median: float
    most: int


class DataCard(BaseModel, frozen=True, extra="forbid"):
    """What is known about a set."""

    format: Literal[1] = 1
    model: str
    """Who designed the machines."""
    made_with: str
    """Command that recorded them."""
    licence: str
    engine: str | None
    """Physics engine; None if nothing was simulated."""
    planned: int
    """Answers that were to be recorded."""
    answers: int
    variants: int
    """Machines made from answers by random edits."""
    gates: tuple[GateCount, ...]
    faults: int
    """Simulations that timed out or crashed: dropped, which says nothing about the machines."""
    pairs: Mapping[str, int]
    """By file."""
    sources: Mapping[str, int]
    """Pairs by source."""
    tokens: Mapping[str, Lengths]
    """Of prompts and replies."""
    objectives: tuple[ObjectiveCount, ...]
    contamination: Mapping[str, Any]
    """Thresholds, and how near each objective comes to a level."""
    published: Mapping[str, int] = dict(PUBLISHED)


def make_card(
    pairs: Sequence[Pair],
    judged: Sequence[Judgement],
    kinds: Mapping[str, str],
    *,
    engine: str | None,
    seed: int,
    likenesses: Mapping[str, Likeness],
    **about: Any,
) -> DataCard:
    """The card of a set.

    Args:
        pairs: The pairs of the set.
        judged: What the gates said about every machine.
        kinds: Name of each objective -> its kind.
        engine: Physics engine, with its version; None if nothing was simulated.
        seed: Decides which objectives are kept apart.
        likenesses: How near each text comes to the levels.
        about: `model`, `made_with`, `licence` and `planned` of the card.
    """
    dropped = Counter(judgement.dropped for judgement in judged)
    kept = Counter(pair.objective for pair in pairs)
    asked = Counter(judgement.objective for judgement in judged)
    apart = _kept_apart(kept, seed)
    sizes = Counter("dev" if pair.objective in apart else "train" for pair in pairs)
    return DataCard(
        **about,
        engine=engine,
        answers=sum(not judgement.variant for judgement in judged),
        variants=sum(bool(judgement.variant) for judgement in judged),
        gates=tuple(_gate_counts(len(judged), dropped, simulated=engine is not None)),
        faults=dropped["simulation"],
        pairs={"train": sizes["train"], "dev": sizes["dev"]},
        sources=dict(sorted(Counter(pair.source for pair in pairs).items())),
        tokens=_tokens(pairs),
        objectives=tuple(
            ObjectiveCount(
                name=name,
                kind=kind,
                split="dev" if name in apart else "train",
                machines=asked[name],
                pairs=kept[name],
            )
            for name, kind in kinds.items()
        ),
        contamination={
            "words": WORDS,
            "most_shared": MOST_SHARED,
            "most_similar": MOST_SIMILAR,
            "texts": {name: vars(found) for name, found in likenesses.items()},
        },
    )


def _kept_apart(kept: Mapping[str, int], seed: int) -> frozenset[str]:
    """Objectives for dev.jsonl: none if there is only one."""
    names = sorted(kept)
    count = max(1, round(DEV_SHARE * len(names))) if len(names) > 1 else 0
    return frozenset(Random(f"{seed}/dev").sample(names, count))


def _gate_counts(entered: int, dropped: Mapping[Any, int], simulated: bool) -> Iterable[GateCount]:
    for gate, meaning in GATES.items():
        if simulated or gate not in ("original", "simulation", "function"):
            passed = entered - dropped[gate]
            yield GateCount(gate=gate, passes=meaning, entered=entered, passed=passed)
            entered = passed


def _tokens(pairs: Sequence[Pair]) -> dict[str, Lengths]:
    prompts = [estimate_tokens(*(item.content for item in pair.prompt)) for pair in pairs]
    replies = [estimate_tokens(pair.reply) for pair in pairs]
    return {name: _lengths(values) for name, values in (("prompt", prompts), ("reply", replies))}


def _lengths(values: Sequence[int]) -> Lengths:
    if not values:
        return Lengths(mean=0, median=0, most=0)
    return Lengths(mean=round(fmean(values), 1), median=median(values), most=max(values))


CARD, CARD_TEXT = "card.json", "README.md"


def write_set(folder: Path, pairs: Sequence[Pair], card: DataCard) -> None:
    """Write train.jsonl, dev.jsonl and the card.

    Raises:
        UsageError: A file cannot be written.
    """
    apart = {item.name for item in card.objectives if item.split == "dev"}
    write_pairs(folder / TRAIN, (pair for pair in pairs if pair.objective not in apart))
    write_pairs(folder / DEV, (pair for pair in pairs if pair.objective in apart))
    write_file(folder / CARD_TEXT, card_text(card))
    write_file(folder / CARD, json.dumps(card.model_dump(mode="json"), indent=1) + "\n")


def card_text(card: DataCard) -> str:
    """The card for people, in Markdown."""
    texts = card.contamination["texts"].items()
    ranked = sorted(texts, key=lambda item: -max(item[1]["shared"], item[1]["cosine"]))
    return fill(
        "agentflow.training.data",
        "card.md",
        card=card,
        head=_head(card),
        train=TRAIN,
        dev=DEV,
        cells=_cells,
        chars_per_token=CHARS_PER_TOKEN,
        shared=MOST_SHARED,
        similar=MOST_SIMILAR,
        words=WORDS,
        nearest=ranked[:10],
    )


def _cells(*cells: object) -> str:
    return " | ".join(str(cell).replace("|", "\\|").replace("\n", " ") for cell in cells)


def _head(card: DataCard) -> str:
    """What hubs read: their name of the licence, and the file of each split that has pairs."""
    splits = (("train", "train", TRAIN), ("dev", "validation", DEV))
    files = [{"split": split, "path": path} for of, split, path in splits if card.pairs[of]]
    head = {
        "pretty_name": "Machines of agentflow",
        "license": "mit" if card.licence == "MIT" else "other",
        "task_categories": ["text-generation"],
        "tags": ["agentflow", "physics", "design"],
        **({"configs": [{"config_name": "default", "data_files": files}]} if files else {}),
    }
    return yaml.safe_dump(head, sort_keys=False)

"""The card of a set: where its pairs come from, and what each gate left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from random import Random
from statistics import fmean, median
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from agentflow.llm.messages import estimate_tokens
from agentflow.training.data.contamination import MOST_SHARED, MOST_SIMILAR, WORDS, Likeness
from agentflow.training.data.gates import GATES, Judgement
from agentflow.training.data.pairs import Pair

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


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class GateCount(_Part):
    """How many machines one gate let through."""

    gate: str
    passes: str
    """What passes it."""
    entered: int
    passed: int


class ObjectiveCount(_Part):
    """How many machines for one objective are in the set."""

    name: str
    kind: str
    split: Literal["train", "dev"]
    machines: int
    """Before the gates."""
    pairs: int


class Lengths(_Part):
    """Lengths in tokens, estimated."""

    mean: float
    median: float
    most: int


class Card(_Part):
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
    model: str,
    made_with: str,
    licence: str,
    engine: str | None,
    planned: int,
    seed: int,
    likenesses: Mapping[str, Likeness],
) -> Card:
    """The card of a set.

    Args:
        pairs: The pairs of the set.
        judged: What the gates said about every machine.
        kinds: Name of each objective -> its kind.
        model: Who designed the machines.
        made_with: Command that recorded them.
        licence: Of the set.
        engine: Physics engine, with its version; None if nothing was simulated.
        planned: Answers that were to be recorded.
        seed: Decides which objectives are kept apart.
        likenesses: How near each text comes to the levels.
    """
    dropped = Counter(judgement.dropped for judgement in judged)
    kept = Counter(pair.objective for pair in pairs)
    asked = Counter(judgement.objective for judgement in judged)
    apart = _kept_apart(kept, seed)
    sizes = Counter("dev" if pair.objective in apart else "train" for pair in pairs)
    return Card(
        model=model,
        made_with=made_with,
        licence=licence,
        engine=engine,
        planned=planned,
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
        contamination=_contamination(likenesses),
    )


def _contamination(likenesses: Mapping[str, Likeness]) -> dict[str, Any]:
    return {
        "words": WORDS,
        "most_shared": MOST_SHARED,
        "most_similar": MOST_SIMILAR,
        "texts": {name: vars(found) for name, found in likenesses.items()},
    }


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

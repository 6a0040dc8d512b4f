"""Mutated replies for every parser: what models send, cut, spliced, repeated and sprinkled."""

from __future__ import annotations

import asyncio
import json
import random
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from agentflow.agents.base import Parsed, Role
from agentflow.agents.designer import Designer, DesignerInput
from agentflow.agents.inspector import Inspector, InspectorInput
from agentflow.agents.meta_designer import MetaDesigner, MetaDesignerInput
from agentflow.agents.querier import Querier, QuerierInput
from agentflow.agents.refiner import Refiner, RefinerInput
from agentflow.agents.registry import scripts
from agentflow.agents.replies import machine_text
from agentflow.llm.messages import Message, Request
from agentflow.llm.procedural import ProceduralClient
from agentflow.machine import extract_json
from agentflow.prompts.render import PromptSet
from tests.agents.fakes import FRAME, MOVEMENT, PLAN, THROWER, THROWING
from tests.timing import repeated, seconds, timed

SPRINKLES = (
    *("{", "}", "[", "]", '"', "'", ",", ":", "//", "/*", "*/", "```", "```json", "<", ">", "</"),
    *("<Modification Steps>", "</Modification Steps>", "<Required Feedback>", "none", "NaN"),
    *("-1", "1e999", "9" * 40, "null", "true", "\\", "\\u", "\x00", "\u2028", "\ud800", "\t", "\n"),
    *("é", "漢", "\U0001f600", "Add 15 to 3 in 0", "Remove 0", "Move 1 to 0 in 2", "blocks 3, 4 |"),
    *('"type"', '"id"', '"face_id"', "x+:", "frontmost: 3", "[" * 300, '{"a":' * 100, "- " * 50),
)
Case = tuple[Role[Any, Any], Any]

CASES: tuple[Case, ...] = (
    (MetaDesigner(), MetaDesignerInput(THROWING)),
    (Designer(), DesignerInput(THROWING)),
    (Designer(), DesignerInput(THROWING, PLAN, "Base", FRAME)),
    (Designer(), DesignerInput(MOVEMENT, representation="coordinates")),
    (Inspector(), InspectorInput(THROWING, THROWER, PLAN)),
    (Querier(), QuerierInput(THROWING, THROWER, 1.0, "Score: 1.00 m")),
    (Refiner(), RefinerInput(THROWING, THROWER, score=1.0, feedback="Score: 1.00 m")),
    (Refiner(), RefinerInput(THROWING, THROWER, format="whole_machine")),
)
"""Every parser, in every format that it reads."""


def replies(case: Case) -> list[str]:
    """What the built-in model answers to the role's own prompt, in five ways."""
    role, given = case
    shown = replace(given, representation="tree") if isinstance(given, DesignerInput) else given
    system, user = PromptSet().render(role.name, role.variables(shown))
    messages = (Message(role="system", text=system), Message(role="user", text=user))

    async def ask(seed: int) -> str:
        request = Request(role=role.name, label=f"fuzz/{seed}", messages=messages)
        return (await ProceduralClient(seed, scripts()).complete(request)).text

    found = [asyncio.run(ask(seed)) for seed in range(5)]
    if isinstance(given, DesignerInput) and given.representation == "coordinates":
        found = [
            f"So:\n```json\n{machine_text(FRAME, 'coordinates')}\n```\nDone. {i}" for i in "ab"
        ]
    return found


def mutate(text: str, other: str, chance: random.Random) -> str:
    """One to four mutations in a row; up to some 200,000 characters."""
    for _ in range(chance.randint(1, 4)):
        start, end = sorted((chance.randint(0, len(text)), chance.randint(0, len(text))))
        kind = chance.randrange(9)
        if kind == 0:
            text = text[:start] + text[end:]
        elif kind == 1:
            text = text[:end] + text[start:]
        elif kind == 2:
            text = text[:start] + chance.choice(SPRINKLES) + text[start:]
        elif kind == 3:
            text = text[:start]
        elif kind == 4:
            text = text[:start] + other[chance.randint(0, len(other)) :]
        elif kind == 5:
            text = text[:start] + text[start:end].swapcase() + text[end:]
        elif kind == 6:
            old, new = chance.choice(SPRINKLES), chance.choice(SPRINKLES)
            text = text.replace(old, new, chance.randint(1, 5))
        elif kind == 7:
            text = text[:start] + text[start:end][::-1] + text[end:]
        elif chance.random() < 0.02:
            text = (text[start:end] or "{") * chance.randint(2, 300)
        text = text[:200_000]
    return text


def outcomes(count: int, seed: int) -> Iterator[tuple[str, str, Parsed[Any], float]]:
    """`count` mutated replies: (role, text, what the parser made of it, slowness).

    Slowness is the time that reading took, in times of plain reading of as long a text, and at
    least `PLAIN` characters. What was slow is timed twice more, and so is plain reading: a parser
    that is not linear is slow each time.
    """
    corpus = [(role, given, replies((role, given))) for role, given in CASES]
    everything = [text for _, _, texts in corpus for text in texts]
    plain = _plain_seconds()
    for number in range(count):
        chance = random.Random(f"{seed}/{number}")
        role, given, texts = corpus[number % len(corpus)]
        text = mutate(chance.choice(texts), chance.choice(everything), chance)
        read = partial(role.parse, given=given)
        parsed, took = timed(read, text)
        if took > SLOW * plain:
            plain = _plain_seconds()
            took = min(took, *(seconds(read, text) for _ in range(2)))
        yield role.name, text, parsed, took / (plain * max(1.0, len(text) / PLAIN))


PLAIN = 100_000
"""Characters of a plain text."""
SLOW = 30.0
"""How many times as long as a plain text a mutated one may take."""


def _plain_seconds() -> float:
    """Seconds to find the JSON in a list of many blocks, with prose around it."""
    text = f"So: [{repeated(json.dumps(THROWER.to_json()[0]) + ', ')(PLAIN)}]. Done."
    return min(seconds(partial(extract_json, kind=list), text) for _ in range(5))


def fault(text: str, parsed: Parsed[Any], slowness: float) -> str:
    """What is wrong with an outcome; "" for nothing."""
    if not isinstance(parsed, Parsed):
        return f"not typed: {parsed!r}"
    if (parsed.output is None) != bool(parsed.problem and parsed.code):
        return f"neither output nor problem: {parsed!r}"
    if slowness > SLOW:
        return f"{slowness:.0f} times as slow as plain text, for {len(text)} characters"
    return ""

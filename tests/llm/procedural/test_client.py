"""The client: deterministic, apologises for unreadable prompts, never raises."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agentflow.agents.meta_designer import MetaDesigner, MetaDesignerInput
from agentflow.agents.registry import scripts
from agentflow.llm.messages import Message, Request, Sampling
from agentflow.llm.procedural import ProceduralClient
from tests.llm.procedural.asking import PROMPTS, brief_of, request

APOLOGY = (
    "Sorry, I cannot answer this prompt. I am a procedural designer, not a language model, and "
    "only answer prompts of the machine-design roles."
)
FORMS = (
    "machine_structure",
    "<Three-Dimensional Perception of the World>",
    "<Required Feedback>",
    "<Modification Steps>",
    "First the rationale",
    "Place cogs",
)


def plan_request(label: str = "meta", seed: int | None = None) -> Request:
    given = MetaDesignerInput(brief_of("throwing"))
    system, user = PROMPTS.render("meta_designer", MetaDesigner().variables(given))
    messages = (Message(role="system", text=system), Message(role="user", text=user))
    sampling = Sampling(seed=seed)
    return Request(role="meta_designer", label=label, messages=messages, sampling=sampling)


async def test_its_name_says_that_it_is_not_a_language_model() -> None:
    client = ProceduralClient(0, scripts())
    reply = await client.complete(plan_request())
    assert client.name == reply.model == "procedural (no language model)"
    assert (reply.finish, reply.usage.total) == ("stop", 0)
    await client.aclose()


async def test_equal_requests_get_equal_replies_from_any_client_in_any_order() -> None:
    first, second = ProceduralClient(3, scripts()), ProceduralClient(3, scripts())
    labels = [f"meta/{number}" for number in range(6)]
    one = {label: (await first.complete(plan_request(label))).text for label in labels}
    other = {label: (await second.complete(plan_request(label))).text for label in labels[::-1]}
    assert one == other
    assert len(set(one.values())) > 1


async def test_its_seed_the_sampling_seed_and_the_label_all_count() -> None:
    async def text(seed: int, sampling: int | None, label: str) -> str:
        return (
            await ProceduralClient(seed, scripts()).complete(plan_request(label, sampling))
        ).text

    assert len({await text(seed, None, "a") for seed in range(6)}) > 1
    assert len({await text(0, seed, "a") for seed in range(6)}) > 1


@pytest.mark.parametrize("text", ["", "hello", "## Your reply\nWrite a poem.", "## Your reply"])
async def test_unreadable_prompts_get_an_apology(text: str) -> None:
    assert (await ProceduralClient(0, scripts()).complete(request(text))).text == APOLOGY


async def test_a_request_without_messages_gets_an_apology() -> None:
    assert (
        await ProceduralClient(0, scripts()).complete(Request(role="x", label="x", messages=()))
    ).text == APOLOGY


PLATE = '{"type": 9000, "id": 0, "parent": -1, "face_id": -1}'
COGS = f'{PLATE},{{"type": 39, "id": 1, "parent": 0, "face_id": 140}}'


@pytest.mark.parametrize("target", [0, 1, 2, 99])
@pytest.mark.parametrize(
    ("blocks", "reply"),
    [(PLATE, "There is no plate with a source."), (COGS, "Cogs at no position.")],
)
async def test_missing_targets_are_ignored(blocks: str, reply: str, target: int) -> None:
    asked = f"## Task\nblock {target} (target) turns in the same sense\n\n## Blocks\n| 38 | Cog |\n"
    text = f"{asked}\n## Current machine\n[{blocks}]\n\n## Your reply\nPlace cogs"
    assert (await ProceduralClient(0, scripts()).complete(request(text))).text.startswith(reply)


@pytest.mark.parametrize("form", FORMS[1:4])
async def test_a_missing_machine_gets_an_apology(form: str) -> None:
    text = f"## Current machine\n[]\n\n## Your reply\n{form}"
    assert (await ProceduralClient(0, scripts()).complete(request(text))).text == APOLOGY


LINES = (
    *(f"## Your reply\n{form}" for form in FORMS),
    "## Task\nTask: x\nexactly one Boulder (type 36)",
    "exactly nine hundred (type 99999)",
    "## Blocks\n| 1 | a |\n| 36 | b |\n| 999 | c |",
    "## Blocks\n| 38 | a |\n| 51 | b |\n| 7 | c |",
    "## Structure to build now\nName: Base\nAllowed types: 1, 36\nGuidance:\nahead 999 to 7",
    "## Structure to build now\nName: Frame\nAllowed types: \nLast structure: yes",
    '## Current machine\n```json\n[{"type": 0, "id": 0, "parent": -1, "face_id": -1}]\n```',
    '## Current machine\n[{"type":0,"id":0,"parent":-1,"face_id":-1},'
    '{"type":38,"id":1,"parent":0,"face_id":0}]',
    "## Simulation feedback\nScore: x\nBroken: block 9 (Log) off block 3 at 0.40 s",
    f"## Current machine\n[{COGS}]",
    "## Task\nblock 1 (target) turns in the same sense\nblock 7 (target) turns in the same sense",
    "## Edit history\n1. Error, score 1.0 -> none\n   Add 1 to 0 in 0",
    "The whole machine stays within 0 m along x, 9.5 m along y and 17 m along z.",
)


@pytest.mark.slow
@given(
    st.lists(st.one_of(st.sampled_from(LINES), st.text(max_size=60)), max_size=12), st.integers()
)
@settings(max_examples=150, deadline=None)
async def test_no_prompt_makes_it_raise(pieces: list[str], seed: int) -> None:
    reply = await ProceduralClient(seed, scripts()).complete(
        request("\n".join(pieces), system=pieces[0] if pieces else "")
    )
    assert reply.text

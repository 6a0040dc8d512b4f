import asyncio

import pytest

from agentflow.search.concurrency import EvaluateOnce, run_concurrently, work_in_order
from agentflow.search.node import Evaluation


async def test_results_come_in_order() -> None:
    async def late(value: int) -> int:
        await asyncio.sleep(0.003 / (value + 1))
        return value

    assert await run_concurrently(late(i) for i in range(4)) == [0, 1, 2, 3]


async def test_a_failure_cancels_the_other_jobs() -> None:
    ended = []

    async def slow() -> None:
        try:
            for _ in range(100):
                await asyncio.sleep(0)
            ended.append("ran on")
        except asyncio.CancelledError:
            ended.append("cancelled")
            raise

    async def fails() -> None:
        await asyncio.sleep(0)
        raise RuntimeError("bug")

    with pytest.raises(RuntimeError, match="bug"):
        await run_concurrently([slow(), fails()])
    assert ended == ["cancelled"]


async def test_each_candidate_is_evaluated_once() -> None:
    asked = []

    async def evaluate(candidate: str, label: str) -> Evaluation:
        asked.append((candidate, label))
        await asyncio.sleep(0)
        return Evaluation(valid=True, score=float(len(candidate)))

    known = Evaluation(valid=True, score=9.0)
    once = EvaluateOnce(evaluate, {"root": known})
    candidates = enumerate(["a", "bb", "a", "root"])
    results = await run_concurrently(once(c, f"label-{i}") for i, c in candidates)
    assert asked == [("a", "label-0"), ("bb", "label-1")]
    assert [result.score for result in results] == [1.0, 2.0, 1.0, 9.0]
    assert await once("bb", "later") is results[1]
    assert once.count == 2


async def test_an_evaluation_lasts_until_its_last_request_is_cancelled() -> None:
    log: list[str] = []
    go = asyncio.Event()

    async def evaluate(candidate: str, _label: str) -> Evaluation:
        log.append(f"{candidate} begins")
        try:
            await go.wait()
        except asyncio.CancelledError:
            log.append(f"{candidate} is cancelled")
            raise
        return Evaluation(True, 1.0)

    once = EvaluateOnce(evaluate)
    first, second = (asyncio.ensure_future(once("a", "")) for _ in range(2))
    await asyncio.sleep(0)
    first.cancel()
    await asyncio.gather(first, return_exceptions=True)
    assert (log, once.count) == (["a begins"], 1)
    second.cancel()
    await asyncio.gather(second, return_exceptions=True)
    assert (log, once.count, once.find("a")) == (["a begins", "a is cancelled"], 0, None)
    go.set()
    found = await once("a", "")
    assert (once.find("a"), once.count) == (found, 1)


async def test_work_in_order_keeps_results_in_order_and_begins_no_more_than_it_may() -> None:
    running, most, kept = 0, 0, list[int]()

    async def work(item: int) -> int:
        nonlocal running, most
        running += 1
        most = max(most, running)
        await asyncio.sleep(0.001 * (5 - item % 5))
        running -= 1
        return item

    await work_in_order(range(12), work, kept.append, 4)
    assert kept == list(range(12))
    assert most == 4


async def test_work_in_order_ends_what_is_in_progress_before_it_raises() -> None:
    kept, ended = list[int](), list[int]()

    async def work(item: int) -> int:
        if item == 1:
            raise ValueError("one")
        await asyncio.sleep(0.01)
        ended.append(item)
        return item

    with pytest.raises(ValueError, match="one"):
        await work_in_order(range(12), work, kept.append, 3)
    assert kept == [0]
    assert ended == [0, 2, 3]


async def test_work_in_order_leaves_nothing_behind_when_it_is_cancelled() -> None:
    cancelled = list[int]()

    async def work(item: int) -> int:
        try:
            await asyncio.sleep(60)
        except asyncio.CancelledError:
            cancelled.append(item)
            raise
        return item

    whole = asyncio.ensure_future(work_in_order(range(12), work, print, 3))
    await asyncio.sleep(0.01)
    whole.cancel()
    with pytest.raises(asyncio.CancelledError):
        await whole
    assert sorted(cancelled) == [0, 1, 2]

from __future__ import annotations

from agentflow.progress import counter, silent


def test_a_counter_says_each_part_that_is_done_and_silence_takes_the_same() -> None:
    told: list[tuple[int, int]] = []
    tick = counter(lambda done, of: told.append((done, of)), 3)
    for _ in range(3):
        tick()
    assert told == [(1, 3), (2, 3), (3, 3)]
    silent(*told[0])

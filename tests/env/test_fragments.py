"""What a machine broke into, by hand-made traces."""

from __future__ import annotations

import numpy as np
import pytest

from agentflow.env.feedback.compose import compose
from agentflow.env.feedback.separation import (
    find_fragments,
    fragment_lines,
    is_root_alone,
    root_velocity,
)
from agentflow.env.rollout import Trace, Verdict
from agentflow.machine.tree import ROOT, Machine, Step

from ..timing import assert_linear
from .fakes import THROWER, make_trace

ROW = Machine((ROOT, Step(1, 15, 0, 0), Step(2, 35, 1, 0), Step(3, 63, 2, 0)))
"""The root (0.25), a block (0.3), a ballast (3), a log."""
PAIRS = ((1, 0), (2, 1), (3, 2))


def broken_at(*samples: int | None) -> Trace:
    """Four blocks that fly apart: block k at k m/s; each connection breaks at its sample."""
    loads = np.zeros((6, 3))
    for column, sample in enumerate(samples):
        if sample is not None:
            loads[sample:, column] = np.nan
    velocity = np.zeros((6, 4, 3))
    velocity[:, :, 2] = np.arange(4)
    path = {block: [(0.0, 1.0, 0.2 * block * k) for k in range(6)] for block in range(4)}
    return make_trace(4, 6, paths=path, velocity=velocity, utilisation=loads, connections=PAIRS)


def test_what_holds_and_what_was_never_joined_has_no_fragments() -> None:
    assert find_fragments(ROW, broken_at(None, None, None)) == []
    assert fragment_lines([]) == []
    loads = np.full((26, 1), 0.1)
    held = make_trace(3, utilisation=loads, connections=((1, 0),))
    assert find_fragments(THROWER, held) == []


def test_fragments_have_the_velocity_of_their_last_separation_and_their_end() -> None:
    root, rest = find_fragments(ROW, broken_at(None, 3, None))
    assert (root.blocks, rest.blocks) == ((0, 1), (2, 3))
    assert (root.time, rest.time) == (pytest.approx(0.6), pytest.approx(0.6))
    assert root.mass == pytest.approx(0.55)
    assert root.velocity[2] == pytest.approx(0.3 / 0.55)
    assert 2.0 < rest.velocity[2] < 3.0
    assert rest.end[2] == pytest.approx(rest.velocity[2])
    first, middle, last = find_fragments(ROW, broken_at(2, 4, None))
    assert (first.blocks, middle.blocks, last.blocks) == ((0,), (2, 3), (1,))
    assert last.time == pytest.approx(0.8)


def test_a_connection_that_broke_while_settling_counts_from_the_start() -> None:
    root, rest = find_fragments(ROW, broken_at(0, None, None))
    assert (root.blocks, root.time, rest.time) == ((0,), 0.0, 0.0)


def test_one_line_tells_the_roots_fragment_and_the_heaviest() -> None:
    trace = broken_at(2, None, None)
    line = (
        "Fragments (blocks: mass, velocity in m/s as it came off, where it ended): "
        "0: 0.2 kg, (0.0, 0.0, 0.0) at 0.40 s, (0.0, 1.0, 0.0); 1-3: "
    )
    (told,) = fragment_lines(find_fragments(ROW, trace))
    assert told.startswith(line)
    feedback = compose(ROW, trace, (), Verdict(0.0, {}), "", (), {}, ())
    assert told in feedback.text.splitlines()
    assert [item["blocks"] for item in feedback.data["fragments"]] == [[0], [1, 2, 3]]
    (crowd,) = fragment_lines(find_fragments(ROW, broken_at(2, 3, 4)))
    assert "; 1 more, 0.3 kg in all" in crowd


def test_the_root_takes_off_with_what_holds_on_to_it() -> None:
    trace = broken_at(3, None, None)
    speeds = root_velocity(ROW, trace)[:, 2]
    assert speeds[2] > 1.9
    assert speeds[3:].tolist() == [0.0, 0.0, 0.0]
    assert [is_root_alone(ROW, trace, index) for index in (2, 3)] == [False, True]


def test_long_machines_fall_apart_in_linear_time() -> None:
    def chain(count: int) -> tuple[Machine, Trace]:
        machine = Machine((ROOT, *(Step(block, 1, block - 1, 0) for block in range(1, count))))
        loads = np.zeros((6, count - 1))
        loads[3:, -1] = np.nan
        pairs = tuple((block + 1, block) for block in range(count - 1))
        return machine, make_trace(count, 6, utilisation=loads, connections=pairs)

    def tell(given: tuple[Machine, Trace]) -> None:
        assert [len(each.blocks) for each in find_fragments(*given)][1:] == [1]
        root_velocity(*given)

    assert_linear(tell, chain, 400)

"""What went wrong is counted by the stated rules, and the stated rules are those of the help."""

from __future__ import annotations

from typing import Any

import pytest

from agentflow.agents.registry import replies_of
from agentflow.cli import main
from agentflow.metrics.failure_kinds import KINDS, STILL
from agentflow.metrics.failures import Failures, failures, kind_of
from agentflow.runs import Event
from agentflow.runs.events import AttemptEvent, EvaluationEvent, StageBeginEvent, ToolEvent
from agentflow.runs.locations import Location
from agentflow.tools.results import StageEnded
from tests.metrics.events import attempt as answered
from tests.metrics.events import evaluation as evaluated


def attempt(code: str, role: str = "designer", **more: Any) -> AttemptEvent:
    return answered(f"{role}/{code}/attempt-1", role=role, code=code, valid=False, **more)


def evaluation(machine: str, broken: int = 0, **more: Any) -> EvaluationEvent:
    breaks = ((1, 0, 0.5),) * broken
    return evaluated("initial/traj-1", 1.0, machine, broken=breaks, **more)


@pytest.mark.parametrize(
    ("event", "name"),
    [
        (attempt("truncated", parsed=False), "cut-off reply"),
        (attempt("empty_reply", parsed=False), "empty reply"),
        (attempt("tool_calls", parsed=False), "empty reply"),
        (attempt("content_filter", parsed=False), "filtered reply"),
        (attempt("empty", parsed=False), "unparsable"),
        (attempt("not_json", parsed=False), "unparsable"),
        (attempt("missing_section", "refiner", parsed=False), "unparsable"),
        (attempt("required_count"), "missing component"),
        (attempt("required_missing", "meta_designer"), "missing component"),
        (attempt("type_outside_structure"), "plan not followed"),
        (attempt("undefined_structure", "meta_designer"), "plan not followed"),
        (attempt("type_not_allowed", parsed=False), "block not allowed"),
        (attempt("face_not_found", parsed=False), "wrong attachment"),
        (attempt("face_occupied", "refiner"), "wrong attachment"),
        (attempt("overlap"), "overlap"),
        (attempt("overlap", "refiner"), "overlap"),
        (attempt("block_not_found", "refiner"), "refused edit"),
        (attempt("no_change", "refiner"), "refused edit"),
        (attempt("size_limit"), "other"),
        (attempt("id_sequence", parsed=False), "other"),
        (attempt("a code of tomorrow"), "other"),
    ],
    ids=lambda value: value.label if isinstance(value, AttemptEvent) else "",
)
def test_a_refused_reply_is_of_one_kind(event: AttemptEvent, name: str) -> None:
    assert kind_of(event, replies_of(event.role)).name == name
    found = failures([event], lambda _: False, replies_of)
    assert {kind: count for kind, count in found.kinds.items() if count} == {name: 1}
    assert (found.replies, found.refused, found.machines) == (1, 1, 0)


def test_what_an_agent_sends_counts_by_its_calls_of_tools() -> None:
    def call(number: int, tool: str, code: str = "") -> ToolEvent:
        location = Location("initial", call=number)
        return ToolEvent(location, tool, {}, refused=bool(code), answer="", code=code)

    found = failures(
        [
            answered("agent/initial/attempt-1", role="agent"),
            call(1, "check", "overlap"),
            call(2, "check", "missing_field"),
            call(3, "check"),
            call(4, "edit", "block_not_found"),
            call(5, "submit", "required_count"),
            call(6, "check", StageEnded().code),
            attempt("no_tool_call", "agent", parsed=False),
        ],
        lambda _: False,
        replies_of,
    )
    assert (found.replies, found.refused) == (5, 4)
    counts = {name: count for name, count in found.kinds.items() if count}
    assert counts == {"overlap": 1, "unparsable": 2, "refused edit": 1}


def test_machines_count_once_and_may_be_of_several_kinds() -> None:
    events = [
        evaluation("a", broken=2, moved=STILL),
        evaluation("a", broken=2, moved=STILL),
        evaluation("b", moved=STILL + 0.001),
        evaluation("c", moved=None),
        evaluation("d", moved=None),
    ]
    found = failures(events, lambda digest: digest in "ab", replies_of)
    assert found.machines == 4
    assert {kind: count for kind, count in found.kinds.items() if count} == {
        "breakage": 1,
        "no motion": 1,
        "wrong facing": 2,
    }


def test_what_is_to_stay_in_place_is_not_motionless() -> None:
    found = failures([evaluation("a", moved=0.0)], lambda _: False, replies_of, in_place=True)
    assert (found.machines, found.kinds["no motion"]) == (1, 0)


def test_accepted_replies_and_other_events_are_no_failures() -> None:
    others = [answered("a"), StageBeginEvent(Location("initial"), 8), Event("unknown", "a", {})]
    assert failures(others, lambda _: True, replies_of) == Failures(replies=1)


def test_runs_add_up() -> None:
    one = failures([attempt("overlap"), evaluation("a", broken=1)], lambda _: False, replies_of)
    both = one + failures([attempt("overlap"), attempt("")], lambda _: False, replies_of)
    assert (both.replies, both.refused, both.machines) == (3, 3, 1)
    assert (both.kinds["overlap"], both.kinds["breakage"], both.kinds["other"]) == (2, 1, 1)
    assert both.codes == {"overlap": 2, "unparsable": 1}


def test_a_code_belongs_to_one_kind() -> None:
    codes = [code for kind in KINDS for code in kind.codes]
    assert len(codes) == len(set(codes))


def test_the_help_states_every_rule(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["failures", "--help"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    for kind in KINDS:
        assert f"{kind.name} ({kind.level}, {kind.unit}): {kind.rule}" in text, kind

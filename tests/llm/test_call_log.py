"""The record on disk."""

from __future__ import annotations

import json
import resource
import tracemalloc
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agentflow.errors import RunError
from agentflow.llm.messages import (
    Message,
    NamedTool,
    Reply,
    Request,
    Sampling,
    Tool,
    ToolCall,
)
from agentflow.llm.wrappers.record import CallLog, RecordedCall, key_of
from agentflow.runs import read_calls
from tests.llm.helpers import ask

CHECK = Tool(name="check", description="Check a machine.", parameters={"type": "object"})
CALL = ToolCall(id="c1", name="check", arguments='{"machine": "[]"')
CALLING = Message(role="assistant", text="", tool_calls=(CALL,))
RESULT = Message(role="tool", text="no blocks", images=("data:,",), tool_call_id="c1")


def no_notice(line: str) -> None:
    pytest.fail(line)


def entry(label: str, text: str = "answer") -> RecordedCall:
    request = ask(label=label)
    return RecordedCall(
        key=key_of("m", request), model="m", request=request, reply=Reply(text=text, retries=2)
    )


def filled(path: Path, count: int = 3) -> list[RecordedCall]:
    entries = [entry(f"a/{i}", "x" * i) for i in range(count)]
    with CallLog(path, no_notice) as call_log:
        for item in entries:
            call_log.append(item)
    return entries


def test_a_line_holds_prompt_and_reply_and_nothing_else(tmp_path: Path) -> None:
    filled(tmp_path / "calls.jsonl", 1)
    (line,) = (tmp_path / "calls.jsonl").read_text().splitlines()
    assert json.loads(line) == {
        "schema_version": 1,
        "key": key_of("m", ask(label="a/0")),
        "model": "m",
        "request": ask(label="a/0").model_dump(mode="json"),
        "reply": Reply(text="", retries=2).model_dump(mode="json"),
    }


def test_entries_are_found_again_by_another_process(tmp_path: Path) -> None:
    entries = filled(tmp_path / "calls.jsonl")
    with CallLog(tmp_path / "calls.jsonl", no_notice, writable=False) as call_log:
        assert len(call_log) == 3
        assert [call_log.find(item.key) for item in entries] == [item.reply for item in entries]
        assert list(call_log.calls()) == entries
        assert call_log.find("other") is None
        assert "other" not in call_log


@settings(deadline=None)
@given(st.text(), st.text())
def test_any_text_survives(tmp_path_factory: pytest.TempPathFactory, text: str, label: str) -> None:
    path = tmp_path_factory.mktemp("calls") / "calls.jsonl"
    item = entry(label, text)
    with CallLog(path, no_notice) as call_log:
        call_log.append(item)
    with CallLog(path, no_notice) as call_log:
        assert list(call_log.calls()) == [item]


def test_tools_and_their_calls_are_recorded(tmp_path: Path) -> None:
    question = ask("hi", "a/0").messages[0]
    request = Request(
        role="r",
        label="a/0",
        messages=(question, CALLING, RESULT),
        tools=(CHECK,),
        tool_choice=NamedTool(name="check"),
    )
    reply = Reply(text="", finish="tool_calls", tool_calls=(CALL,))
    call = RecordedCall(key=key_of("m", request), model="m", request=request, reply=reply)
    with CallLog(tmp_path / "calls.jsonl", no_notice) as call_log:
        call_log.append(call)
        assert list(call_log.calls()) == [call]
        assert call_log.find(call.key) == reply


def test_lines_without_tools_do_not_mention_them(tmp_path: Path) -> None:
    filled(tmp_path / "calls.jsonl", 1)
    assert "tool" not in (tmp_path / "calls.jsonl").read_text()


def test_a_half_written_last_line_is_dropped_wherever_it_breaks(tmp_path: Path) -> None:
    path = tmp_path / "calls.jsonl"
    entries = filled(path, 2)
    whole = path.read_bytes()
    first = whole.index(b"\n") + 1
    for size in range(first + 1, len(whole) - 1, 37):
        path.write_bytes(whole[:size])
        notices: list[str] = []
        with CallLog(path, notices.append, writable=False) as call_log:
            assert len(call_log) == 1
        assert path.stat().st_size == size
        with CallLog(path, notices.append) as call_log:
            assert call_log.find(entries[0].key) == entries[0].reply
            call_log.append(entries[1])
        dropped = f"{path}: dropped a half-written last line ({size - first} bytes)"
        assert notices == [dropped, dropped]
        assert path.read_bytes() == whole


def test_a_last_line_that_lacks_its_line_break_alone_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "calls.jsonl"
    entries = filled(path, 3)
    whole = path.read_bytes()
    path.write_bytes(whole[: whole.index(entries[2].key.encode())].rpartition(b"\n")[0])
    assert not path.read_bytes().endswith(b"\n")
    with CallLog(path, no_notice, writable=False) as call_log:
        assert list(call_log.calls()) == entries[:2]
    with CallLog(path, no_notice) as call_log:
        call_log.append(entries[2])
        assert list(call_log.calls()) == entries
    assert path.read_bytes() == whole


def test_a_call_log_is_never_whole_in_memory(tmp_path: Path) -> None:
    path = tmp_path / "calls.jsonl"
    with CallLog(path, no_notice) as call_log:
        for number in range(60):
            call_log.append(entry(f"a/{number}", "x" * 500_000))
    tracemalloc.start()
    try:
        with CallLog(path, no_notice, writable=False) as call_log:
            assert sum(len(item.reply.text) for item in call_log.calls()) == 30_000_000
            assert call_log.find(entry("a/59").key) is not None
            peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 4_000_000


def test_a_damaged_line_elsewhere_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "calls.jsonl"
    filled(path)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text(lines[0] + "{oops\n" + lines[2])
    with pytest.raises(RunError) as caught:
        CallLog(path, no_notice)
    assert str(caught.value) == f"{path}, line 2 is damaged (not JSON)"


def test_a_foreign_schema_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "calls.jsonl"
    filled(path, 1)
    path.write_text(path.read_text().replace('"schema_version":1', '"schema_version":2'))
    with pytest.raises(RunError, match=r"line 1 is damaged \(schema_version\)"):
        CallLog(path, no_notice)


def test_a_call_log_that_cannot_be_opened(tmp_path: Path) -> None:
    missing = tmp_path / "no" / "calls.jsonl"
    with pytest.raises(RunError) as caught:
        CallLog(missing, no_notice)
    assert str(caught.value) == f"cannot open {missing}: No such file or directory"


def test_a_full_disk_takes_back_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "calls.jsonl"
    filled(path, 1)
    whole = path.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with CallLog(path, no_notice) as call_log:
        resource.setrlimit(resource.RLIMIT_FSIZE, (len(whole) + 100, hard))
        try:
            with pytest.raises(RunError) as caught:
                call_log.append(entry("a/1"))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        assert str(caught.value) == f"cannot write {path}: File too large"
        assert path.read_bytes() == whole
        assert call_log.find(entry("a/1").key) is None
        call_log.append(entry("a/1"))
        assert call_log.find(entry("a/1").key) == entry("a/1").reply


def test_the_key_is_of_what_changes_the_answer() -> None:
    base = ask("hi", "a/1")
    changed = [
        base.model_copy(update={"label": "a/2"}),
        base.model_copy(update={"role": "refiner"}),
        base.model_copy(update={"messages": (Message(role="system", text="hi"),)}),
        base.model_copy(update={"messages": (*base.messages, *base.messages)}),
        base.model_copy(update={"messages": (*base.messages, CALLING)}),
        base.model_copy(update={"messages": (*base.messages, CALLING, RESULT)}),
        base.model_copy(update={"tools": (CHECK,)}),
        base.model_copy(update={"tools": (CHECK,), "tool_choice": "required"}),
        base.model_copy(update={"tools": (CHECK,), "tool_choice": NamedTool(name="check")}),
        *[
            base.model_copy(update={"sampling": sampling})
            for sampling in (
                Sampling(temperature=0.8),
                Sampling(top_p=1.0),
                Sampling(max_tokens=1),
                Sampling(seed=0),
                Sampling(stop=("x",)),
                Sampling(response_format="json_object"),
            )
        ],
    ]
    keys = {key_of("m", request) for request in [base, *changed]} | {key_of("n", base)}
    assert len(keys) == len(changed) + 2
    assert set(Sampling.model_fields) == {
        "temperature", "top_p", "max_tokens", "seed", "stop", "response_format",
    }  # fmt: skip


def test_the_key_stays_the_same_over_versions() -> None:
    request = Request(role="r", label="l", messages=(Message(role="user", text="ü"),))
    assert key_of("m", request) == (
        "25d942e9f3d00f384d83eb2e3f2043e1666477bb9023030c80660ea39d5ae05a"
    )


def conversation(turns: int, size: int = 10) -> list[RecordedCall]:
    """Calls of a conversation with tools, in which each reply and each result has this size."""
    messages = [Message(role="system", text="design"), Message(role="user", text="task")]
    calls = []
    for turn in range(turns):
        request = Request(role="agent", label=f"a/{turn}", messages=tuple(messages), tools=(CHECK,))
        call = CALL.model_copy(update={"id": f"c{turn}", "arguments": str(turn) * size})
        reply = Reply(
            text=" said " if turn % 2 else "", tool_calls=(call,), reasoning_field="thought"
        )
        calls.append(
            RecordedCall(key=key_of("m", request), model="m", request=request, reply=reply)
        )
        messages.append(reply.message.model_copy(update={"text": reply.text.strip()}))
        messages.append(Message(role="tool", text="x" * size, tool_call_id=call.id))
    return calls


def test_a_conversation_is_recorded_once(tmp_path: Path) -> None:
    path = tmp_path / "calls.jsonl"
    calls = conversation(14, 100_000)
    with CallLog(path, no_notice) as call_log:
        for call in calls[:7]:
            call_log.append(call)
    with CallLog(path, no_notice) as resumed:
        for call in calls[7:]:
            resumed.append(call)
        assert list(resumed.calls()) == calls
        assert [resumed.find(call.key) for call in calls] == [call.reply for call in calls]
    assert path.stat().st_size < 14 * 350_000  # alone, replies and results have 200,000 a turn
    told = [call.model_dump(mode="json") for call in calls]
    assert list(read_calls(tmp_path)) == told


def test_two_conversations_do_not_disturb_each_other(tmp_path: Path) -> None:
    first, second = conversation(4), conversation(4, 20)
    other = [call.model_copy(update={"key": f"other-{call.key}"}) for call in second]
    mixed = [call for pair in zip(first, other, strict=True) for call in pair]
    with CallLog(tmp_path / "calls.jsonl", no_notice) as call_log:
        for call in mixed:
            call_log.append(call)
        assert list(call_log.calls()) == mixed
    lines = (tmp_path / "calls.jsonl").read_text().splitlines()
    alone = [len(json.loads(line)["request"]["messages"]) for line in lines]
    assert max(alone) == 2
    assert [call["request"]["label"] for call in read_calls(tmp_path)] == [
        call.request.label for call in mixed
    ]


def test_records_of_earlier_versions_hold_every_message_and_are_read(tmp_path: Path) -> None:
    path, calls = tmp_path / "calls.jsonl", conversation(3)
    path.write_text("".join(f"{call.model_dump_json()}\n" for call in calls))
    with CallLog(path, no_notice, writable=False) as call_log:
        assert list(call_log.calls()) == calls
    assert list(read_calls(tmp_path)) == [call.model_dump(mode="json") for call in calls]


@pytest.mark.parametrize("change", [{"after": "nothing"}, {"shared": 99}])
def test_a_call_that_continues_none_is_damage(tmp_path: Path, change: dict[str, object]) -> None:
    path = tmp_path / "calls.jsonl"
    with CallLog(path, no_notice) as call_log:
        for call in conversation(2):
            call_log.append(call)
    first, second = map(json.loads, path.read_text().splitlines())
    path.write_text(f"{json.dumps(first)}\n{json.dumps(second | change)}\n")
    with pytest.raises(RunError, match=r"line 2 is damaged \(it continues a call that"):
        CallLog(path, no_notice, writable=False)
    with pytest.raises(RunError, match="damaged in line 2: it continues a call that is not before"):
        list(read_calls(tmp_path))

"""Every line of a client over stdio is answered, also one that is no message."""

from __future__ import annotations

import pytest
from mcp import types
from pydantic import ValidationError

from agentflow.integrations.mcp.serving import answer_to

CALL = '{"jsonrpc": "2.0", "id": %s, "method": "tools/call", "params": %s}'
MACHINE = '{"name": "check", "arguments": {"machine": %s}}'
SURROGATE = CALL % (7, MACHINE % '"\\ud800"')
DEEP = "[" * 400 + "]" * 400
LISTED = CALL % (9, "[1]")
LINES = {
    SURROGATE: (7, types.PARSE_ERROR),
    CALL % ('"a"', MACHINE % DEEP): ("a", types.PARSE_ERROR),
    LISTED: (9, types.INVALID_REQUEST),
    "[]": (None, types.INVALID_REQUEST),
    "hello": (None, types.PARSE_ERROR),
    CALL % ("[1]", "[1]"): (None, types.INVALID_REQUEST),
    "[" * 100_000: (None, types.PARSE_ERROR),
}


@pytest.mark.parametrize("line", LINES, ids=range(len(LINES)))
def test_the_error_has_the_id_of_the_line(line: str) -> None:
    with pytest.raises(ValidationError) as error:
        types.jsonrpc_message_adapter.validate_json(line, by_name=False)
    answer = answer_to(error.value)
    assert (answer.id, answer.error.code) == LINES[line]
    assert len(answer.error.message) < 300

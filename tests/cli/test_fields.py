"""Fields of results: columns of tables, labelled lines."""

from __future__ import annotations

import pytest

from agentflow.cli.display.output import Field, answer, field, output, print_lines, table
from agentflow.metrics.tables import number

FIELDS = (
    field("name"),
    field("score", "value", number),
    answer("valid", "valid", "not checked"),
    Field("double", lambda item: str(2 * item["value"]) if item.get("value") else None),
)
FULL = {"name": "one", "value": 1.5, "valid": True}
BARE = {"valid": None}


def test_a_table_has_a_dash_where_a_result_lacks_a_field(
    capsys: pytest.CaptureFixture[str],
) -> None:
    output().print(table(FIELDS, [FULL, None, BARE]))
    assert [line.split() for line in capsys.readouterr().out.splitlines()] == [
        ["name", "score", "valid", "double"],
        ["one", "1.50", "yes", "3.0"],
        [],
        ["-", "-", "not", "checked", "-"],
    ]


def test_a_list_has_no_line_for_what_a_result_lacks(capsys: pytest.CaptureFixture[str]) -> None:
    print_lines(FIELDS, FULL)
    print_lines(FIELDS, BARE)
    assert capsys.readouterr().out.splitlines() == [
        "name: one",
        "score: 1.50",
        "valid: yes",
        "double: 3.0",
        "valid: not checked",
    ]

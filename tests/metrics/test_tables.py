"""The forms of a table, to the letter."""

from __future__ import annotations

import csv
import io
import json

from agentflow.metrics.intervals import Rate
from agentflow.metrics.tables import (
    PUBLISHED,
    Column,
    Row,
    Table,
    as_json,
    cell_text,
    comma_separated,
    latex,
    markdown,
    text,
)

TABLE = Table(
    "Inspector",
    ("task", "model"),
    (
        Column("with", "valid"),
        Column("with", "rate", percent=True),
        Column("without_it", "valid"),
    ),
    (Row(("throwing", "a|b_c"), (Rate(5, 8), 0.5, None)),),
    (Row(("throwing", "Published 1"), ("5", "97.87%", None)),),
    ("1 run.",),
)
BARE = Table("Bare", ("run",), (Column("", "score"),), (Row(("x",), (1.25,)),))


def test_cells() -> None:
    assert [cell_text(value) for value in (None, 1.005, 3, "5", Rate(1, 2))] == [
        "-",
        "1.00",
        "3",
        "5",
        "1/2",
    ]
    assert cell_text(0.97872, in_percent=True) == "97.87%"
    assert cell_text("97.87%", in_percent=True) == "97.87%"


def test_text() -> None:
    assert text(TABLE) == (
        "Inspector\n"
        "\n"
        "                                with  without_it\n"
        "task      model        valid    rate       valid\n"
        "------------------------------------------------\n"
        "throwing  a|b_c          5/8  50.00%           -\n"
        "------------------------------------------------\n"
        f"{PUBLISHED}\n"
        "throwing  Published 1      5  97.87%           -\n"
        "\n"
        "1 run.\n"
    )


def test_text_without_groups_published_rows_and_notes() -> None:
    assert text(BARE) == "Bare\n\nrun  score\n----------\nx     1.25\n"


def test_markdown() -> None:
    assert markdown(TABLE) == (
        "**Inspector**\n"
        "\n"
        "| task | model | with valid | with rate | without\\_it valid |\n"
        "| --- | --- | ---: | ---: | ---: |\n"
        "| throwing | a\\|b\\_c | 5/8 | 50.00% | - |\n"
        "\n"
        f"*{PUBLISHED}*\n"
        "\n"
        "| task | model | with valid | with rate | without\\_it valid |\n"
        "| --- | --- | ---: | ---: | ---: |\n"
        "| throwing | Published 1 | 5 | 97.87% | - |\n"
        "\n"
        "1 run.  \n"
    )


def test_comma_separated_tells_the_source_and_keeps_full_precision() -> None:
    table = Table("x", ("model",), (Column("a", "mean"),), (Row(('say "a, b"',), (1 / 3,)),))
    rows = list(csv.reader(io.StringIO(comma_separated(table))))
    assert rows == [["source", "model", "a mean"], ["measured", 'say "a, b"', repr(1 / 3)]]
    assert list(csv.reader(io.StringIO(comma_separated(TABLE))))[1:] == [
        ["measured", "throwing", "a|b_c", "5", "8", "0.5", ""],
        ["published", "throwing", "Published 1", "5", "", "97.87%", ""],
    ]


def test_latex() -> None:
    assert latex(TABLE) == (
        "% Inspector\n"
        "\\begin{tabular}{llrrr}\n"
        "\\toprule\n"
        "&  & \\multicolumn{2}{c}{with} & \\multicolumn{1}{c}{without\\_it} \\\\\n"
        "task & model & valid & rate & valid \\\\\n"
        "\\midrule\n"
        "throwing & a|b\\_c & 5/8 & 50.00\\% & - \\\\\n"
        "\\midrule\n"
        f"\\multicolumn{{5}}{{l}}{{{PUBLISHED}}} \\\\\n"
        "throwing & Published 1 & 5 & 97.87\\% & - \\\\\n"
        "\\bottomrule\n"
        "\\end{tabular}\n"
        "% 1 run.\n"
    )


def test_latex_means_every_character_literally() -> None:
    table = Table("t", ("m",), (Column("", "x"),), (Row(("\\a{b}~^&%$#_",), (1,)),))
    assert (
        "\\textbackslash{}a\\{b\\}\\textasciitilde{}\\textasciicircum{}\\&\\%\\$\\#\\_ & 1 \\\\"
        in latex(table)
    )


def test_json() -> None:
    assert json.loads(as_json(TABLE)) == {
        "title": "Inspector",
        "columns": [
            {"group": "with", "name": "valid count"},
            {"group": "with", "name": "valid of"},
            {"group": "with", "name": "rate"},
            {"group": "without_it", "name": "valid"},
        ],
        "measured": [{"task": "throwing", "model": "a|b_c", "values": [5, 8, 0.5, None]}],
        "published": [
            {"task": "throwing", "model": "Published 1", "values": ["5", None, "97.87%", None]}
        ],
        "notes": ["1 run."],
    }


def test_no_form_obeys_what_stands_in_a_name() -> None:
    rows = (Row(("=HYPERLINK(1)\n& \\end{tabular}",), (1.0,)),)
    hostile = Table("T\n\\input{x}", ("model",), (Column("@a", "b"),), rows, notes=("n\n\\x",))
    assert comma_separated(hostile) == (
        "source,model,'@a b\nmeasured,\"'=HYPERLINK(1)\n& \\end{tabular}\",1.0\n"
    )
    assert "=HYPERLINK(1) \\& \\textbackslash{}end\\{tabular\\} & 1.00 \\\\\n" in latex(hostile)
    assert "% T \\input{x}\n" in latex(hostile)
    assert "% n \\x\n" in latex(hostile)

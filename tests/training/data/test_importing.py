"""Sets are made of public conversations, and of Besiege machines with captions."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from agentflow.api import design_prompt
from agentflow.cli import main
from agentflow.machine import read_machine
from agentflow.machine.formats.bsg_writing import to_bsg
from agentflow.training.data.pairs import Pair, read_pairs

pytest.importorskip("sklearn")
Captured = pytest.CaptureFixture[str]
RECORDED = Path(__file__).parents[3] / "runs" / "recorded-throwing"
CART = [
    {"type": 0, "id": 0, "parent": -1, "face_id": -1},
    {"type": 1, "id": 1, "parent": 0, "face_id": 0},
    {"type": 2, "id": 2, "parent": 1, "face_id": 1},
]
PLANK = CART[:2]


def conversation(text: str, machine: object, **fields: object) -> dict[str, object]:
    reply = f"A rationale.<|im_end|>\n```json\n{json.dumps(machine)}\n```"
    return {
        "messages": [
            {"role": "system", "content": "You design machines."},
            {"role": "user", "content": text},
            {"role": "assistant", "content": reply},
        ],
        **fields,
    }


def import_(source: Path, out: Path, *options: str) -> list[str]:
    return ["data", "import", str(source), "--out", str(out), *options]


def pairs_in(out: Path) -> list[Pair]:
    return [*read_pairs(out / "train.jsonl"), *read_pairs(out / "dev.jsonl")]


def test_conversations_become_pairs(tmp_path: Path, capsys: Captured) -> None:
    rows = [
        conversation("A cart for hay.", CART),
        conversation("A cart for hay.", CART),
        conversation("A plank.", PLANK, objective="plank", source="somebody"),
        conversation("Nothing.", "no machine"),
        conversation(
            "Build a machine that flies as high as possible.", CART[:1], objective="plank"
        ),
    ]
    file = tmp_path / "public.jsonl"
    file.write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert main(import_(file, tmp_path / "set", "--licence", "CC-BY-4.0", "--json")) == 0
    card = json.loads(capsys.readouterr().out)
    counts = {item["gate"]: item["entered"] - item["passed"] for item in card["gates"]}
    assert counts == {"objective": 1, "parse": 1, "validity": 0, "evaluation": 0, "duplicate": 1}
    assert (card["licence"], card["engine"]) == ("CC-BY-4.0", None)
    pairs = {pair.source: pair for pair in pairs_in(tmp_path / "set")}
    assert set(pairs) == {"imported from public.jsonl", "somebody"}
    assert pairs["somebody"].objective == "plank"
    cart = pairs["imported from public.jsonl"]
    assert (list(cart.machine), cart.score) == (CART, None)
    assert cart.rationale == "A rationale."
    assert "<|im_end|>" not in cart.reply
    assert cart.prompt[0].content == "You design machines."


def test_the_brief_of_a_level_is_found_in_any_message_of_a_prompt(
    tmp_path: Path, capsys: Captured
) -> None:
    asked, told = conversation("Begin now.", CART), conversation("Begin now.", PLANK)
    asked["messages"][0]["content"] = design_prompt("throwing")[1]["content"]  # type: ignore[index]
    file = tmp_path / "public.json"
    file.write_text(json.dumps([asked, told]))
    assert main(import_(file, tmp_path / "set", "--json")) == 0
    gate = json.loads(capsys.readouterr().out)["gates"][0]
    assert (gate["gate"], gate["entered"], gate["passed"]) == ("objective", 2, 1)


def test_older_chat_formats_and_lists_are_read(tmp_path: Path) -> None:
    row = {
        "conversations": [
            {"from": "human", "value": "A plank."},
            {"from": "gpt", "value": json.dumps(PLANK)},
        ]
    }
    (tmp_path / "old.json").write_text(json.dumps([row]))
    assert main(import_(tmp_path / "old.json", tmp_path / "set")) == 0
    [pair] = pairs_in(tmp_path / "set")
    assert [message.role for message in pair.messages] == ["user", "assistant"]


def test_besiege_machines_with_captions_become_pairs(tmp_path: Path) -> None:
    folder = tmp_path / "machines"
    folder.mkdir()
    cart, plank = (read_machine(item).machine for item in (CART, PLANK))
    assert cart is not None
    assert plank is not None
    (folder / "cart.bsg").write_text(to_bsg(cart))
    (folder / "cart.txt").write_text("A handcart\nfor hay.\n")
    (folder / "plank.bsg").write_text("<Machine>no machine</Machine>")
    (folder / "plank.txt").write_text("A plank.")
    assert main(import_(folder, tmp_path / "set")) == 0
    [pair] = pairs_in(tmp_path / "set")
    assert "A handcart for hay." in pair.prompt[1].content
    assert len(pair.machine) == len(CART)
    assert json.loads((tmp_path / "set" / "card.json").read_text())["answers"] == 2


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("", "rows.jsonl holds nothing to import"),
        ("{half\n", "rows.jsonl, line 1 is not JSON: "),
        ("[1, 2", "rows.jsonl is not JSON: "),
        ('{"messages": []}\n', 'rows.jsonl, line 1: expected {"messages": [...]} with messages of'),
        ("7\n", "rows.jsonl, line 1: expected "),
        ('{"messages": [{"role": "user", "content": 7}, {}]}', "rows.jsonl, line 1: expected "),
    ],
)
def test_damaged_files_are_named(
    content: str, problem: str, tmp_path: Path, capsys: Captured
) -> None:
    (tmp_path / "rows.jsonl").write_text(content)
    assert main(import_(tmp_path / "rows.jsonl", tmp_path / "set")) == 2
    assert problem in capsys.readouterr().err
    assert not (tmp_path / "set").exists()


def test_files_that_are_no_text_are_named(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "rows.jsonl").write_bytes(b"\xff\xfe\x00")
    for source, problem in (
        (tmp_path / "rows.jsonl", "rows.jsonl is not UTF-8 text"),
        (tmp_path / "missing", "cannot read "),
        (Path("/dev/null"), "/dev/null is neither a file nor a folder"),
    ):
        assert main(import_(source, tmp_path / "set")) == 2
        assert problem in capsys.readouterr().err


def test_a_machine_without_caption_and_a_full_folder_are_refused(
    tmp_path: Path, capsys: Captured
) -> None:
    folder = tmp_path / "machines"
    folder.mkdir()
    (folder / "cart.bsg").write_text("<Machine/>")
    assert main(import_(folder, tmp_path / "set")) == 2
    assert "cart.bsg has no caption: write what it is in cart.txt" in capsys.readouterr().err
    (folder / "cart.txt").write_text("A cart.")
    assert main(import_(folder, folder)) == 2
    assert "machines is not empty; choose another folder with --out" in capsys.readouterr().err

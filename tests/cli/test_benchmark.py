"""`agentflow benchmark` and `agentflow leaderboard` as a user types them."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from selenium.webdriver.common.by import By

from agentflow.app.benchmark.card import read_card
from agentflow.app.benchmark.plan import CALLS
from agentflow.app.benchmark.run import make_card
from agentflow.app.sweeps.tables import read_sweep_result
from agentflow.cli import main
from agentflow.files.folders import hold_folder
from tests.app.benchmark.boards import SMALL, write
from tests.report.browser import chromium, complaints

pytestmark = pytest.mark.slow
COMMAND = [sys.executable, "-c", "import sys; from agentflow.cli import main; sys.exit(main())"]
Captured = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Cards of the procedural model and of random machines, in `small` and `small-random-dsl`."""
    folder = tmp_path_factory.mktemp("boards")
    words = ["benchmark", str(write(folder)), "--out", str(folder), "--quiet"]
    assert main(words) == 0
    assert main([*words, "--random"]) == 0
    return folder


def test_the_card_has_every_item_and_its_cost(folder: Path) -> None:
    card = read_card(folder / "small" / "card.json")
    assert (card.complete, card.model) == (True, "procedural (no language model)")
    assert [item.item for item in card.items] == ["gearing-1", "gearing-2"]
    assert [len(item.parts["first"]) for item in card.items] == [2, 2]
    assert (card.cost.calls, card.cost.money) == (2 * (2 + 3), 0.0)
    assert card.cost.rollouts <= 2 * (2 + 3)
    for item in card.items:
        attempts = [*item.parts["first"], *item.parts["refined"]]
        assert all(attempt.share in (0.0, 1.0) for attempt in attempts)
        assert {attempt.outcome for attempt in attempts} <= {"scored", "invalid"}
        assert item.full == 1.0


def test_a_killed_benchmark_goes_on_where_it_was(folder: Path, tmp_path: Path) -> None:
    words = ["benchmark", str(write(tmp_path)), "--out", str(tmp_path), "--jobs", "1"]
    process = subprocess.Popen([*COMMAND, *words], stdout=subprocess.DEVNULL)
    runs, deadline = tmp_path / "small" / "runs", time.monotonic() + 120
    while not list(runs.glob("*/result.json")):
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.05)
    process.kill()
    process.wait()
    done = {path: path.stat().st_mtime_ns for path in runs.glob("*/result.json")}
    assert main(["benchmark", str(tmp_path / "small"), "--resume", "--quiet"]) == 0
    assert {path: path.stat().st_mtime_ns for path in done} == done
    assert read_card(tmp_path / "small" / "card.json") == read_card(folder / "small" / "card.json")


def test_an_endpoint_that_fails_costs_no_points(tmp_path: Path, capsys: Captured) -> None:
    """There is no card, and the status is that of the endpoint."""
    dead = ["--model", "nobody", "--base-url", "http://127.0.0.1:9/v1"]
    path = tmp_path / "small-nobody"
    words = ["benchmark", str(write(tmp_path)), "--out", str(tmp_path), "--quiet", *dead]
    assert main([*words, "--set", "model.endpoint.retry.attempts=1"]) == 4
    told = capsys.readouterr()
    assert "no answer from http://127.0.0.1:9/v1" in told.err
    assert told.err.endswith(
        "agentflow: no run could use its endpoint, so there is no scorecard; when it answers, "
        f"continue with: agentflow benchmark {path} --resume --trust\n"
    )
    assert not (path / "card.json").exists()


def test_items_without_a_run_are_missing_and_not_worth_nothing(
    folder: Path, tmp_path: Path
) -> None:
    path = shutil.copytree(folder / "small", tmp_path / "small")
    shutil.rmtree(path / "runs" / "refined.gearing-2.seed-0")
    with (path / "members.jsonl").open("a") as log:
        log.write('{"run": "refined.gearing-2.seed-0", "state": "failed", "reason": "no answer"}\n')
    card = make_card(read_sweep_result(path))
    assert (card.complete, card.missing) == (False, ("gearing-2",))
    (refined,) = card.items[1].parts["refined"]
    assert (refined.outcome, refined.share) == ("missing", None)
    assert refined.reason == "the run failed; members.jsonl has the reason"
    assert card.total["refined"].mean == card.items[0].share("refined")


def test_lite_does_one_item_of_each_family(tmp_path: Path, capsys: Captured) -> None:
    words = ["benchmark", str(write(tmp_path)), "--out", str(tmp_path), "--quiet", "--lite"]
    assert main([*words, "--json"]) == 0
    card = json.loads(capsys.readouterr().out)
    assert [item["item"] for item in card["items"]] == ["gearing-1"]
    assert card["conditions"]["lite"] is True


def test_a_folder_of_cards_stands_for_them_if_they_can_be_compared(
    tmp_path: Path, capsys: Captured
) -> None:
    cards = Path(__file__).parents[2] / "docs" / "cards"
    assert main(["leaderboard", str(cards)]) == 2
    told = capsys.readouterr().err
    assert f"{cards} has cards of 3 benchmarks, which cannot be compared: write " in told
    words = next(each.split() for each in told.split(" or ") if "procedural.json" in each)
    assert main(words[words.index("leaderboard") :]) == 0
    capsys.readouterr()
    for name in ("eleven-items-procedural.json", "eleven-items-random.json"):
        shutil.copy(cards / name, tmp_path)
    assert main(["leaderboard", str(tmp_path)]) == 0
    assert "random edits" in capsys.readouterr().out
    (tmp_path / "empty").mkdir()
    assert main(["leaderboard", str(tmp_path / "empty")]) == 2
    assert "empty has no card.json" in capsys.readouterr().err


def test_cards_are_checked_before_they_are_compared(folder: Path, capsys: Captured) -> None:
    words = ["leaderboard", str(folder / "small"), "--check", "--benchmark"]
    assert main([*words, str(folder / "small.yaml")]) == 0
    assert "6 machines have their scores on" in capsys.readouterr().out
    assert main([*words, "benchmark"]) == 2
    assert "benchmark has no part refined: choose from first" in capsys.readouterr().err


def test_parts_keep_their_budgets_and_their_courses(tmp_path: Path, capsys: Captured) -> None:
    """A budget of the plan ends a run, and its best machine counts; one of the user does not."""
    parts = {
        "first": SMALL["axes"]["part"]["first"],
        "long": {"workflow": "iterative", "placements": 9, "max_simulations": 9, CALLS: 3},
    }
    file = write(tmp_path, axes={"part": parts, "task": SMALL["axes"]["task"]})
    words = ["benchmark", str(file), "--out", str(tmp_path), "--quiet", "--part", "long"]
    assert main([*words, "--seeds", "2"]) == 0
    path = tmp_path / "small-long-2-seeds"
    card = read_card(path / "card.json")
    assert (card.complete, card.parts, card.seeds, card.cost.calls) == (True, ("long",), 2, 12)
    for item in card.items:
        assert [one.seed for one in item.parts["long"]] == [0, 1]
        for one in item.parts["long"]:
            assert one.area is not None
            assert 0 <= one.area <= 1
            spent = [point.simulations for point in one.course]
            assert spent == sorted({*spent})
            assert all(0 < each <= 3 for each in spent)
    capsys.readouterr()
    again = ["leaderboard", str(path), "--check", "--benchmark", str(file)]
    assert main(again) == 0
    assert "4 machines have their scores" in capsys.readouterr().out
    with hold_folder(path):
        assert main(["benchmark", str(path), "--resume", "--quiet"]) == 2
    assert f"{path} is in use by another process" in capsys.readouterr().err

    del parts["long"][CALLS]
    write(tmp_path, axes={"part": parts, "task": SMALL["axes"]["task"]})
    limited = [*words, "--set", f"{CALLS}=3", "--json"]
    assert main(limited) == 3
    (stopped, *_) = json.loads(capsys.readouterr().out)["items"][0]["parts"]["long"]
    assert (stopped["outcome"], stopped["share"]) == ("stopped", None)


def test_a_leaderboard_opens_in_a_browser(
    folder: Path, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, capsys: Captured
) -> None:
    cards = [str(folder / name / "card.json") for name in ("small-random-dsl", "small")]
    board = tmp_path / "board.html"
    assert main(["leaderboard", *cards, "--html", str(board)]) == 0
    out = capsys.readouterr().out
    assert out.startswith("Benchmark version 2, ")
    ranks = [line.split()[:2] for line in out.splitlines() if line[:1] in ("1", "2")]
    assert ranks == [["1", "procedural"], ["2", "none"]]
    assert out.endswith(f"{board}\n")
    with chromium(tmp_path_factory.mktemp("profile")) as driver:
        driver.get(board.as_uri())
        assert driver.title == "Leaderboard · agentflow"
        headings = [item.text for item in driver.find_elements(By.CSS_SELECTOR, "h2")]
        assert headings == ["Ranking", "Families", "Machines", "How it ended", "All numbers"]
        assert driver.find_element(By.TAG_NAME, "h1").text == "Leaderboard"
        shares = driver.find_elements(By.CSS_SELECTOR, ".turned button")
        shares[-1].click()
        item, model = str(shares[-1].get_attribute("aria-label")).partition(":")[0].split(", ")
        shown = driver.find_element(By.CSS_SELECTOR, ".title").text
        assert shown == f"{item} · {shares[-1].text.splitlines()[0]} · {model}"
        assert driver.find_element(By.CSS_SELECTOR, ".shares").text.split()[0] == "gearing"
        driver.find_element(By.CSS_SELECTOR, "svg .ratio")
        assert "procedural (no language model)" in driver.page_source
        assert complaints(driver) == []

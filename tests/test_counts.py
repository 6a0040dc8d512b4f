"""Numbers and names in prose are those of the code: README, docs, changelog, help, configurations.

A pattern applies wherever its words are found, so that a new sentence is compared as well. `N`
stands for a number, in digits or as a word.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from math import prod
from typing import Any, get_args

import pytest
import yaml

from agentflow.app.pages.runs import BEST
from agentflow.cli.commands.analysis import PAIRS, QUESTIONS
from agentflow.cli.commands.sweeps import LISTED
from agentflow.config.run import DesignConfig
from agentflow.diversity.measures import DIMENSIONS, Measures
from agentflow.diversity.solid import POINTS
from agentflow.env.constants import constants
from agentflow.env.physics.registry import ENGINES
from agentflow.env.pool.pool import GRACE
from agentflow.env.simulation.variations import GENERAL, PERTURBATIONS, VARIATIONS
from agentflow.env.tasks.records import read_records
from agentflow.env.tasks.registry import get_task, task_names
from agentflow.llm.endpoint.faults import TRANSIENT_STATUSES
from agentflow.llm.settings import RetrySettings
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import SIZE_LIMIT
from agentflow.machine.controls import MAX_CONTROLS
from agentflow.machine.edits.script import MAX_COMMANDS
from agentflow.machine.formats.parse import MAX_BLOCKS
from agentflow.search.registry import STRATEGIES
from agentflow.study.episodes import Label
from agentflow.study.segments import AFTER, BEFORE
from agentflow.tools.bench import MOST_CHARACTERS, TOOLS
from agentflow.workflows.tools import MOST_CALLS, MOST_REFUSED, MOST_SILENT, ROLLOUTS
from tests.loops import for_each
from tests.pages import PAGES, page, rows

WORDS = (
    *("one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten"),
    *("eleven", "twelve", "thirteen", "fourteen", "fifteen", "sixteen"),
)
NUMBER = rf"(\d[\d,]*|{'|'.join(WORDS)})"
CONFIG = DesignConfig()
SETTINGS = CONFIG.settings


def sweep(name: str) -> dict[str, Any]:
    document: dict[str, Any] = yaml.safe_load(PAGES[f"configs/{name}.yaml"])
    return document


@cache
def families() -> tuple[str, ...]:
    return tuple(name for name in task_names() if "/" not in name)


BENCHMARK = sweep("benchmark")
ITEMS: dict[str, dict[str, Any]] = BENCHMARK["axes"]["task"]
FIRST, SEARCH = BENCHMARK["axes"]["part"]["first"], BENCHMARK["axes"]["part"]["search"]
ITEMS_OF = Counter(get_task(item["task"]).family for item in ITEMS.values())
EXTENDED = sum(block.extended for block in library().values())
ENGINE_PAGE = page("validation.md")

NUMBERS: tuple[tuple[str, float], ...] = (
    # tasks and machines
    (r"N (?:task families|families of tasks)", len(families())),
    (r"N \*?levels\*? each", 5),
    (r"N core types", len(library()) - EXTENDED),
    (r"N extended types", EXTENDED),
    (r"N supported types", len(library())),
    (r"machine may have (?:at most )?N blocks", get_task("movement").brief.limits.blocks or 0),
    (r"another limit, from 1 to N; 0 removes", MAX_BLOCKS),
    (r"[Aa] script may have N commands", MAX_COMMANDS),
    (r"program has at most N entries", MAX_CONTROLS),
    (r"(?:for at most|[Aa]fter at most|takes up to) N s\b(?=[ .,])", constants()["settle_most"]),
    # roles, workflows and search
    (r"N search strategies", len(STRATEGIES.ours)),
    (r"`max_retry` attempts in total \(default: N\)", CONFIG.max_retry),
    (r"(?:asks the model|cogs on a given plate) N times", SETTINGS.placements),
    (r"plans anew after every N\b", SETTINGS.trajectories),
    (r"revises it in N rounds", SETTINGS.search.rounds),
    (r"requests? N edits", SETTINGS.search.width),
    (r"N strategies with \d+ rounds each", len(sweep("search_strategy")["axes"]["condition"])),
    (r"strategies with N rounds each", SETTINGS.search.rounds),
    (r"same model in N workflows", len(sweep("workflows")["axes"]["workflow"])),
    # tools
    (r"N tools\b", len(TOOLS)),
    (r"up to N (?:submitted )?machines(?: in each stage)?", SETTINGS.candidates_per_stage),
    (r"N simulations \(`settings\.\w+`", ROLLOUTS),
    (r"N pictures \(`settings\.\w+`", SETTINGS.max_pictures),
    (r"when N replies in a row call no tool", MOST_SILENT),
    (r"when N calls in a row were refused", MOST_REFUSED),
    (r"after N calls,", MOST_CALLS),
    (r"texts of more than N characters", MOST_CHARACTERS),
    # scores
    (r"(?:adds|simulated) N to \d+ (?:more times|simulations)", len(GENERAL) - 1),
    (r"(?:adds|simulated) \d+ to N (?:more times|simulations)", len(VARIATIONS) - 1),
    (r"simulated N times, all with the same task", len(PERTURBATIONS)),
    (r"10 % quantile of the N scores", len(PERTURBATIONS)),
    (r"[Oo]ne of the N (?:simulations|times)", len(PERTURBATIONS)),
    (r"takes? N simulations of each machine", len(PERTURBATIONS)),
    (r"at most N \| any number", ENGINES["pybullet"].most_parts or 0),
    # benchmark
    (r"N fixed tasks", len(ITEMS)),
    (r"N \*items\*", len(ITEMS)),
    (r"N for each of \w+ families", max(ITEMS_OF.values())),
    (r"for each of N families", len(ITEMS_OF)),
    (r"N independent first replies", FIRST["trajectories"]),
    (r"at most N model calls and", SEARCH["model.budget.calls"]),
    (r"model calls and N simulations", SEARCH["max_simulations"]),
    (r"`placement`: N, 24, 24 and", FIRST["placements"]),
    # measures
    (r"N measures, by shape", len(Measures.__dataclass_fields__) - 1),
    (r"\| points \| N \|", POINTS),
    (r"\| length of vectors \| N \|", DIMENSIONS),
    (r"N pairs in all \(`--pairs`\)", PAIRS),
    (r"N questions \(`--questions`\)", QUESTIONS),
    (r"one of N labels", len(get_args(Label))),
    (r"sees the task, the episode with the N before it", BEFORE),
    (r"the N after it, each with its actions", AFTER),
    # endpoints, sweeps, reports, clusters
    (r"back-off and jitter \(at most N s\)", RetrySettings().cap_s),
    (r"`Retry-After` time \(at most N s\)", RetrySettings().retry_after_cap_s),
    (r"more than N runs, it prints one line", LISTED),
    (r"best N machines (?:have a film|at 30 samples)", BEST),
    (r"ended N s after the time limit", GRACE),
)


def value(text: str) -> float:
    """The number that digits or a word stand for."""
    word = text.lower()
    return WORDS.index(word) + 1 if word in WORDS else float(text.replace(",", ""))


def found(pattern: str) -> Iterator[tuple[str, float]]:
    """Where a pattern with `N` matches, and the number there."""
    words = re.compile(re.sub(r"\bN\b", lambda _: NUMBER, pattern), re.IGNORECASE)
    for path, text in PAGES.items():
        for match in words.finditer(text):
            line = text.count("\n", 0, match.start()) + 1
            yield f"{path}:{line}: {match[0]}", value(match[1])


@pytest.mark.slow
@for_each(NUMBERS)
def test_a_number_in_prose_is_that_of_the_code(pattern: str, number: float) -> None:
    places = dict(found(pattern))
    assert places, f"no page has {pattern!r} any more: remove it or follow the new words"
    wrong = [place for place, shown in places.items() if shown != number]
    assert wrong == [], f"it is {number:g}"


@pytest.mark.parametrize(
    ("text", "number"), [("Nine", 9), ("1,000", 1000), ("37", 37), ("sixteen", 16)]
)
def test_numbers_are_read(text: str, number: float) -> None:
    assert re.fullmatch(NUMBER, text, re.IGNORECASE)
    assert value(text) == number


def test_the_size_limit_is_stated_right() -> None:
    sizes = {
        size for text in PAGES.values() for size in re.findall(r"at most ([\d. x]+) m\b", text)
    }
    assert " x ".join(f"{size:g}" for size in SIZE_LIMIT) in sizes
    assert len({size for size in sizes if " x " in size}) == 1


def test_levels_with_a_longer_window_are_named() -> None:
    text = page("tasks.md")
    [sentence] = re.findall(r"The windows are those of level 1\. (.*?) have a longer one", text)
    [rocket] = re.findall(r"\| rocket \| [^|]+ \| \(30 s from level (\d) on\)", text)
    shown = set(re.findall(r"\w+/\d", sentence))
    for family, first in [*re.findall(r"(\w+) from level (\d) on", sentence), ("rocket", rocket)]:
        shown |= {f"{family}/{level}" for level in range(int(first), 8)}
    shown &= set(task_names())
    longer = {
        name for name in task_names() if get_task(name).window > get_task(name.split("/")[0]).window
    }
    assert shown == longer


def test_items_of_the_benchmark_are_listed() -> None:
    text = page("how-to/benchmark.md")
    first = text.partition("\n## Scorecards")[0]
    shown = {cells[0]: cells[1] for cells in rows(first) if cells[0] in ITEMS}
    assert shown == {name: item["task"] for name, item in ITEMS.items()}
    assert set(ITEMS_OF) == set(families())
    assert len(set(ITEMS_OF.values())) == 1


def test_the_ratio_of_speeds_is_that_of_the_measurements() -> None:
    ratios = sorted(
        float(ratio) for ratio in re.findall(r"([\d.]+) x PyBullet's", page("results/engines.md"))
    )
    assert f"| speed | 1 | {ratios[0]:.1f} to {ratios[-1]:.1f} times as fast |" in ENGINE_PAGE


def test_sweeps_are_listed_with_their_numbers_of_runs() -> None:
    listed = {}
    for cells in rows(page("sweeps.md")):
        files, runs = re.findall(r"`(\w+)\.yaml`", cells[0]), re.findall(r"\d+", cells[-1])
        listed |= dict(zip(files, map(int, runs), strict=False))
    counted = {}
    for path in PAGES:
        if path.startswith("configs/") and path.count("/") == 1 and "axes:" in PAGES[path]:
            plan = sweep(path.removeprefix("configs/").removesuffix(".yaml"))
            counted[path] = prod(len(axis) for axis in plan["axes"].values()) * len(plan["seeds"])
    del counted["configs/benchmark.yaml"]  # it has a page of its own
    assert {f"configs/{name}.yaml": runs for name, runs in listed.items()} == counted


def test_statuses_that_are_tried_again_are_listed() -> None:
    [listed] = re.findall(r"HTTP status ([\d, or]+) \| the call is made", page("endpoints.md"))
    assert {int(status) for status in re.findall(r"\d+", listed)} == TRANSIENT_STATUSES


def test_engines_of_published_results_are_stated_right() -> None:
    """Validation says: all except the learning experiment were made with PyBullet."""
    assert "| all except the learning experiment |" in re.sub(
        r"\[([^]]+)\]\([^)]+\)", r"\1", ENGINE_PAGE
    )
    shown = {
        path: set(re.findall(r"Physics engine: (\w+)\b(?! \()", text))
        for path, text in PAGES.items()
        if path.startswith("docs/") and re.search(r"Physics engine: \w+\b(?! \()", text)
    }
    assert {path for path, engines in shown.items() if engines != {"pybullet"}} == {
        path for path in shown if path.endswith("/learning.md")
    }
    assert {r.engine.partition(" ")[0] for r in read_records().values()} == {"pybullet"}


def test_pages_agree_on_how_well_loops_close() -> None:
    [metres] = re.findall(r"its bars keep their distance within ([\de.-]+) m\b", page("physics.md"))
    [millimetres] = re.findall(r"keep their distance within ([\d.]+) mm\b", ENGINE_PAGE)
    assert float(metres) * 1000 == float(millimetres)

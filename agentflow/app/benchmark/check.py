"""Simulates the machines of scorecards again, and looks for what differs and what is copied."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from agentflow.app.benchmark.card import (
    DIGITS,
    FIRST,
    NAME,
    CountedMachine,
    Scorecard,
    Shares,
    read_card,
    summarise,
)
from agentflow.app.benchmark.make import MACHINES
from agentflow.app.benchmark.plan import ITEM, PART, Item, conditions, plan_benchmark, read_items
from agentflow.app.benchmark.run import make_card
from agentflow.app.sweeps.tables import read_sweep_result
from agentflow.config.run import DesignConfig
from agentflow.diversity.topology import tree_edit_distance, tree_hash
from agentflow.env.physics.registry import ENGINES
from agentflow.env.pool.pool import Pool, RolloutPool
from agentflow.env.tasks.records import TaskRecord, read_records, record_machine
from agentflow.env.verification import verify_async
from agentflow.errors import RunError, UsageError
from agentflow.extras import install, is_installed
from agentflow.files.documents import first_difference
from agentflow.machine import Machine, library, read_machine
from agentflow.progress import Progress, counter

NEAR = 2
"""Most edits between the trees of a machine and of the one that it copies."""
SMALL = 10
"""Machines of fewer blocks are alike without being copied: only the same ones are named."""


def check_cards(
    paths: Sequence[Path], source: Path, *, tolerance: float, workers: int, say: Progress
) -> tuple[str, ...]:
    """Simulate all machines of cards again, on their engines.

    Args:
        paths: Cards, or directories of benchmarks, whose runs are then counted again.
        source: The file of their benchmark.
        tolerance: Greatest difference of scores, as a share: other platforms round otherwise.
        workers: Number of processes.
        say: Receives progress.

    Returns:
        Sentences: how many machines have the scores of their card, and which are near copies.

    Raises:
        RunError: A card states what is not so, or has no machine for a score.
        UsageError: A card is of another benchmark, or of another version of it.
        ConfigError: The engine of a card is not installed.
    """

    async def check_all() -> list[str]:
        async with RolloutPool(workers) as pool:
            found = [await _check(path, source, tolerance, pool, say) for path in paths]
        return [sentence for sentences in found for sentence in sentences]

    return tuple(asyncio.run(check_all()))


@dataclass(frozen=True)
class _Attempt:
    """A machine that counts, and what it counts for."""

    where: str
    stated: CountedMachine
    machine: Machine | None
    part: str
    item: Item
    config: DesignConfig

    async def again(self, pool: Pool, tolerance: float) -> str:
        """What simulations find in place of what the card states; "" if that is the same."""
        stated, item = self.stated, self.item
        if stated.outcome not in ("scored", "diverged"):
            none = 0.0 if stated.outcome == "invalid" else None
            return "" if stated.score == stated.share == none else "states a score without one"
        if self.machine is None:
            return "has a score and no machine"
        score, fragile = await self._simulate(pool)
        if score is None:  # it may have taken too long, on a busy computer
            return f"states the score {stated.score}, but did not end with one here: check again"
        if stated.score is None:
            return f"states no score, but has {score:g}"
        share, whole = item.share(score), item.par.par - item.par.floor
        room = tolerance * abs(score) + 10.0**-DIGITS
        if abs(score - stated.score) > room or abs((stated.share or 0.0) - share) > room / whole:
            return (
                f"states the score {stated.score:g} and the share {stated.share}, but has "
                f"{score:g} and {share}"
            )
        return "" if tolerance or fragile == stated.fragile else "states another fragility"

    async def _simulate(self, pool: Pool) -> tuple[float | None, bool | None]:
        """The score that counts, and whether the machine is fragile."""
        assert self.machine is not None
        task = replace(self.item.task, engine=self.config.engine)
        run = partial(pool.run, self.machine, task, seed=self.config.seed)
        if self.part == FIRST:
            return (await run()).score, None
        found = await verify_async(self.machine, task, run)
        score = found.low if self.item.lowest else found.score
        return score, None if found.holding is None else found.holding.fragile


async def _check(
    path: Path, source: Path, tolerance: float, pool: Pool, say: Progress
) -> list[str]:
    """What is found about one card; see `check_cards`."""
    card = read_card(path / NAME if path.is_dir() else path)
    if not card.holds_machines:
        return [f"{card.model}: not checkable: the card holds no machines; make it again."]
    attempts = _attempts(card, path, source)
    tick = counter(say, len(attempts))

    async def again(attempt: _Attempt) -> str:
        found = await attempt.again(pool, tolerance)
        tick()
        return found and f"{attempt.where} {found}"

    wrong = [*filter(None, await asyncio.gather(*map(again, attempts)))]
    if wrong := [*wrong, *_wrong_means(card), *_wrong_runs(card, path)]:
        more = f", and so do {len(wrong) - 1} more" if wrong[1:] else ""
        hint = "" if tolerance else "; a card of another platform is checked with --tolerance 0.05"
        raise RunError(f"{path} states what is not so: {wrong[0]}{more}{hint}")
    engine = card.conditions["engine"]
    count = sum(attempt.machine is not None for attempt in attempts)
    spent = "" if path.is_dir() else "; its costs are not checked, because its runs are not here"
    return [
        f"{card.model}: {count} machines have their scores on {engine}{spent}.",
        *_copies(card, attempts, source),
    ]


def _attempts(card: Scorecard, path: Path, source: Path) -> list[_Attempt]:
    """The attempts of a card, which must be those of the benchmark."""
    options = {"engine": card.conditions["engine"].partition(" ")[0]}
    lite, seeds = card.conditions["lite"], card.seeds
    plan = plan_benchmark(source, (), options, lite=lite, parts=card.parts, seeds=seeds)
    if other := first_difference(card.conditions, conditions(plan.sweep)):
        raise UsageError(
            f"{path} cannot be checked with {source}: its {other.key} is {other.before}, not "
            f"{other.now}; use agentflow {card.agentflow}, and the benchmark that it was made with"
        )
    configs = {
        (run.labels[PART], run.labels[ITEM], run.config.seed): run.config for run in plan.runs
    }
    items = read_items(plan.sweep)
    planned = [(n, i.task.name, i.knobs, i.par.par) for n, i in items.items()]
    if planned != [(i.item, i.task, i.knobs, i.full) for i in card.items]:
        raise RunError(f"{path} states what is not so: its items are not those of {source}")
    found = []
    for item in card.items:
        for part, machines in item.parts.items():
            most = seeds * (
                configs[part, item.item, 0].settings.trajectories if part == FIRST else 1
            )
            if len(machines) != most and item.share(part) is not None:
                raise RunError(
                    f"{path} states what is not so: {item.item} has {len(machines)} machines of "
                    f"{part} in place of {most}"
                )
            found += [
                _Attempt(
                    f"{item.item}, {part}",
                    stated,
                    read_machine(stated.machine, tuple(library())).machine,
                    part,
                    items[item.item],
                    configs[part, item.item, stated.seed],
                )
                for stated in machines
            ]
    return found


def _wrong_means(card: Scorecard) -> Iterator[str]:
    """Which means are not those of the items."""

    def means(shares: Shares) -> object:
        return {part: found.mean for part, found in shares.items()}

    now = summarise(card.items)
    if means(card.total) != means(now["total"]) or card.complete != now["complete"]:
        yield "its total is not that of its items"
    for name, shares in card.families.items():
        if name not in now["families"] or means(shares) != means(now["families"][name]):
            yield f"the mean of {name} is not that of its items"


def _wrong_runs(card: Scorecard, path: Path) -> Iterator[str]:
    """What the runs of a card say otherwise, if they are here."""
    if not path.is_dir():
        return
    result = read_sweep_result(path)
    now = make_card(result)
    for run in result.finished:
        config, record, stated = run.planned.config, run.numbers.record, run.result
        for did, spent, states, most in (
            (
                "simulated machines",
                len(record.machines),
                stated.rollouts,
                config.settings.max_simulations,
            ),
            ("made calls", record.calls, stated.calls, config.model.budget.calls),
        ):
            if spent != states or (most is not None and spent > most):
                yield (
                    f"{run.planned.name} {did}: {spent}, states {states}, and has a budget of "
                    f"{most}"
                )
    for key in ("cost", "items"):
        if getattr(card, key) != getattr(now, key):
            yield f"its {key} are not those of its runs"


def _copies(card: Scorecard, attempts: Sequence[_Attempt], source: Path) -> Iterator[str]:
    """With what machines were compared, and which are records or pars, or nearly."""
    blocks = tuple(library())
    pars = {
        f"the par {file.stem}": read_machine(file.read_text("utf-8"), blocks).machine
        for file in sorted((source.parent / MACHINES).glob("*.json"))
    }
    recorded = {f"the record {name}": record_machine(name) for name in _records()}
    known = {name: machine for name, machine in (recorded | pars).items() if machine}
    near = f"at most {NEAR} edits" if _measures_trees() else f"no edits ({install('diversity')})"
    lacking = sum(machine is None for machine in recorded.values())
    yield (
        f"{card.model}: compared with the machines of {len(recorded) - lacking} records and "
        f"{len(pars)} pars, whose copies have {near}; of {lacking} records only trees are known."
    )
    told = {
        f"COPY? {card.model}: {attempt.where} is {edits or 'no'} edits from {of}."
        for attempt in attempts
        if attempt.machine and attempt.stated.share
        for of, edits in _like(attempt.machine, known)
    }
    yield from sorted(told)


def _records() -> dict[str, TaskRecord]:
    """The records of all engines by name: of other engines, those with a tree of their own."""
    found = dict[str, TaskRecord]()
    for engine in ("", *ENGINES):
        known = {record.tree for record in found.values()}
        own = read_records(engine).values()
        found |= {record.name: record for record in own if not engine or record.tree not in known}
    return found


def _measures_trees() -> bool:
    return is_installed("apted")


def _like(machine: Machine, known: Mapping[str, Machine]) -> Iterator[tuple[str, int]]:
    """The known machines that one is near to, by tree: names and edits."""
    if len(machine) < SMALL:
        yield from ((name, 0) for name, other in known.items() if other == machine)
        return
    tree, types = tree_hash(machine), Counter(step.type for step in machine)
    others = {f"the record {name}": record.tree for name, record in _records().items()}
    yield from ((name, 0) for name, theirs in others.items() if theirs == tree)
    for name, other in known.items():
        differing = Counter(step.type for step in other)
        differing.subtract(types)
        # there are at least as many edits, and trees take long
        if max(sum((+differing).values()), sum((-differing).values())) > NEAR:
            continue
        edits = round(tree_edit_distance(machine, other)) if _measures_trees() else NEAR + 1
        if 0 < edits <= NEAR or (not edits and name not in others):
            yield name, edits

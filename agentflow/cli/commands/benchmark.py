"""Commands for the benchmark and its leaderboards. Importing this module registers them."""

import sys
from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from agentflow.cli import options
from agentflow.cli.commands.sweeps import print_estimate
from agentflow.cli.display.text import escape_controls, show_count
from agentflow.cli.root import PARTLY, allow, approve, commands, print_json, print_table

DEFAULT = Path("configs/benchmark.yaml")


@commands.command(epilog="Example: agentflow benchmark --model NAME --base-url URL --lite")
def benchmark(
    source: Annotated[Path, typer.Argument()] = DEFAULT,
    model: options.ModelName = None,
    base_url: options.BaseUrl = None,
    settings: options.Settings = None,
    engine: options.Engine = None,
    lite: bool = False,
    random: bool = False,
    parts: Annotated[list[str] | None, typer.Option("--part")] = None,
    seeds: Annotated[int | None, typer.Option(min=1)] = None,
    jobs: options.Jobs = 2,
    workers: options.SharedWorkers = None,
    out: Path = Path("sweeps"),
    resume: options.ResumeRuns = False,
    dry_run: options.DryRun = False,
    trust: options.Trust = False,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> None:
    """Measure a model on fixed tasks and write a scorecard, card.json.

    Scores are given as shares: 0 % at an item's floor, which random machines reach, 100 % at its
    par, which a long search of the built-in designer or a known machine reaches, and at most 150 %.
    `agentflow leaderboard` compares scorecards.

    Args:
        source: Benchmark file or existing benchmark directory.
        lite: Only the first item of each task family.
        random: Random machines and edits in place of a model, as a baseline.
        parts: Part to do, such as first, search, agent or long; repeat it for several (default: the
            first two of the file).
        seeds: Do each part with seeds 0 to N-1 (default: 1 seed).
        out: Parent directory of the benchmark's directory.
    """
    from agentflow.app.benchmark.leaderboard import format_tables, leaderboard
    from agentflow.app.benchmark.plan import plan_benchmark
    from agentflow.app.benchmark.run import run_benchmark
    from agentflow.app.design.trust import trust_option
    from agentflow.app.sweeps.plan import sweep_folder
    from agentflow.cli.display.sweep_live import watch_sweep

    keys = {"model.name": model, "model.base_url": base_url, "engine": engine, "workers": workers}
    allowed = allow if trust or dry_run else approve
    plan = plan_benchmark(
        source,
        settings or (),
        keys,
        lite=lite,
        random=random,
        parts=parts or (),
        seeds=seeds,
        approve=allowed,
    )
    folder = sweep_folder(plan, source, out)
    if dry_run:
        print_estimate(plan, folder, as_json)
        return
    with watch_sweep(len(plan.runs), quiet) as watcher:
        outcome = run_benchmark(plan, folder, watcher, jobs=jobs, resume=resume)
    if as_json:
        print_json(outcome.card.model_dump(mode="json", by_alias=True))
    else:
        text = format_tables(leaderboard([outcome.card])[:1], "text")
        print(escape_controls(text, "\n"))
        print(f"scorecard: {outcome.file}")
    if not outcome.card.complete:
        if not as_json:
            again = f"agentflow benchmark {quote(str(folder))} --resume{trust_option(plan.configs)}"
            print(f"do the missing runs with: {again}")
        raise typer.Exit(PARTLY)


@commands.command(epilog="Example: agentflow new-benchmark --seed 7 --items 33 --out fresh")
def new_benchmark(
    out: Annotated[Path, typer.Option()],
    seed: options.Seed = 0,
    items: Annotated[int, typer.Option(min=1, max=1100)] = 33,
    simulations: Annotated[int, typer.Option(min=1)] = 2000,
    workers: options.Workers = 2,
    machines: Path | None = None,
    as_json: options.Json = False,
) -> None:
    """Draw a benchmark that nobody has seen: set.yaml, for agentflow benchmark.

    An item's share is 0 at its floor, the score of random machines, and 1 at its par, the score of
    the built-in designer and its search, or of a known machine. Machines that reach the pars are
    kept apart: do not publish them. The same command continues what was stopped.

    Args:
        out: Directory of the benchmark; it can be continued.
        items: Number of items; they go round the families.
        simulations: Simulations of the search that sets an item's par.
        machines: Directory of machines that may set pars as well, such as records.
    """
    from agentflow.app.benchmark.make import make_benchmark

    made = make_benchmark(
        out,
        seed=seed,
        items=items,
        simulations=simulations,
        workers=workers,
        known=machines,
        say=lambda line: print(f"agentflow: {escape_controls(line)}", file=sys.stderr),
    )
    if as_json:
        print_json(made.to_json())
        return
    print(f"benchmark: {escape_controls(str(made.file))}")
    print(f"solutions, to be kept apart: {escape_controls(str(made.machines))}")
    if made.near:
        print(f"first machines come near the par of: {', '.join(made.near)}")
    if made.unsolved:
        print(f"the par is the greatest possible score of: {', '.join(made.unsolved)}")
    print(f"use it: agentflow benchmark {quote(str(made.file))}")


@commands.command(epilog="Example: agentflow leaderboard a/card.json b/card.json --html board.html")
def leaderboard(
    cards: list[Path],
    form: options.FormatOrJson = "text",
    html: Path | None = None,
    check: bool = False,
    source: Annotated[Path, typer.Option("--benchmark")] = DEFAULT,
    tolerance: Annotated[float, typer.Option(min=0, max=1)] = 0.0,
    workers: options.Workers = 2,
) -> None:
    """Compare scorecards: ranking, shares by family, shares by item.

    The seal of a card reveals accidents, not lies. With --check, every machine of the cards is
    simulated again on the engine of its card, means and costs are counted again, and machines that
    copy a record are named.

    Args:
        cards: Scorecards, directories of benchmarks, or folders of scorecards of one benchmark.
        html: Also write an HTML page to this file.
        check: Simulate all machines of the cards again; refuse cards that differ.
        source: With --check: the benchmark file of the cards.
        tolerance: With --check: how far scores may differ, as a share.
    """
    from agentflow.app.benchmark.leaderboard import find_cards, format_tables, read_cards
    from agentflow.app.benchmark.leaderboard import leaderboard as compare

    cards = [file for path in cards for file in find_cards(path)]
    found = read_cards(cards)
    told: tuple[str, ...] = ()
    if check:
        from agentflow.app.benchmark.check import check_cards

        say = show_count("machine")
        told = check_cards(cards, source, tolerance=tolerance, workers=workers, say=say)
    print_table(format_tables(compare(found, told), form), form)
    if html:
        from agentflow.app.benchmark.page import leaderboard_page

        print(leaderboard_page(found, html, told))

"""New benchmarks: drawn from a seed, continued, and run; shares between floor and par."""

from __future__ import annotations

import asyncio
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

from agentflow.app.benchmark import make
from agentflow.app.benchmark.card import read_card
from agentflow.app.benchmark.plan import Item
from agentflow.cli import main
from agentflow.config.run import load_document
from agentflow.config.sweep import Par, read_sweep
from agentflow.env.tasks.registry import FAMILIES, get_task
from agentflow.env.verification import verify
from agentflow.errors import RunError, UsageError
from agentflow.files.ranges import ends_of
from agentflow.machine.validity import check
from tests.loops import for_each

ROOT = Path(__file__).parents[3]


def test_shares_begin_at_the_floor_and_end_at_one_and_a_half() -> None:
    item = Item(get_task("throwing"), {}, False, Par(floor=10.0, par=30.0))
    assert [item.share(score) for score in (0.0, 10.0, 20.0, 30.0, 99.0)] == [0, 0, 0.5, 1, 1.5]


@for_each(sorted(make.content()["items"]))
def test_draws_differ_and_are_in_their_ranges(family: str) -> None:
    for template in make.content()["items"][family]:
        drawn = {number: changes for number, changes, *_ in make._draws(template, "0/x")}
        assert len(drawn) == make.DRAWS
        again = {number: changes for number, changes, *_ in make._draws(template, "0/x")}
        assert drawn == again, "from the seed alone"
        several = [changes for seed in "xyz" for _, changes, *_ in make._draws(template, seed)]
        for key, value in template.items():
            ends = ends_of(value)
            numbers = [changes[key] for changes in several]
            if ends:
                assert len({*numbers}) > 1, key
                assert float(ends[0]) <= min(numbers) <= max(numbers) <= float(ends[1])
            else:
                assert numbers == [value] * 3 * make.DRAWS


def test_every_family_has_three_items() -> None:
    content = make.content()["items"]
    assert set(content) == set(FAMILIES)
    assert {len(templates) for templates in content.values()} == {3}
    for templates in content.values():
        assert sum("requirements.wanted" in template for template in templates) == 1


def test_a_verification_that_failed_sets_no_par(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = SimpleNamespace(score=3.0, verified_score=None)
    monkeypatch.setattr(make, "design", lambda *_args, **_named: result)
    with pytest.raises(RunError, match=r"throwing-1\.0\.floor: a simulation of its verification"):
        make.make_benchmark(tmp_path, items=1, simulations=8, say=print)
    assert not (tmp_path / "set.yaml").exists()


def _scores(monkeypatch: pytest.MonkeyPatch, **scores: float) -> list[str]:
    """Give each solver a score; the names of the runs that were made."""
    machine = SimpleNamespace(to_text=lambda: "[]")
    runs: list[str] = []

    def solve(_folder: Path, name: str, *_rest: object) -> SimpleNamespace:
        runs.append(name)
        return SimpleNamespace(verified_score=scores[name.rpartition(".")[2]])

    monkeypatch.setattr(make, "_solve", solve)
    monkeypatch.setattr(make, "best_machine", lambda run: machine if run.verified_score else None)
    return runs


def test_an_unsolved_item_has_the_greatest_possible_score_as_its_par(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = _scores(monkeypatch, floor=0.0, first=0.0, par=0.0)
    template = make.content()["items"]["jumping"][0]
    item = make._draw(tmp_path, "jumping-1", template, 0, 8, 1)
    assert (item.par.floor, item.par.par, item.machine) == (0.0, 10.0, None)
    assert runs == ["jumping-1.0.floor", "jumping-1.0.first", "jumping-1.0.par"]
    _scores(monkeypatch, floor=0.0, first=4.0, par=4.5)
    item = make._draw(tmp_path, "jumping-1", template, 0, 8, 1)
    assert (item.par.par, item.reached, item.machine) == (10.0, 0.4, None), "hardly more"
    _scores(monkeypatch, floor=0.0, first=0.0, par=1.0)
    item = make._draw(tmp_path, "jumping-1", template, 0, 8, 1)
    assert (item.par.par, item.machine) == (10.0, None), "one of ten trials"
    _scores(monkeypatch, floor=0.0, first=0.0, par=0.0)
    template = make.content()["items"]["throwing"][0]
    with pytest.raises(UsageError, match="throwing-1: nothing in 4 draws scored more than random"):
        make._draw(tmp_path, "throwing-1", template, 0, 8, 1)


def test_an_item_that_first_machines_solve_is_drawn_again_without_a_search(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = _scores(monkeypatch, floor=0.0, first=9.0, par=10.0)
    template = make.content()["items"]["lifting"][0]
    item = make._draw(tmp_path, "lifting-1", template, 0, 8, 1)
    assert (item.par.par, item.reached) == (10.0, 0.9)
    assert len(runs) == 2 * make.DRAWS
    assert not [name for name in runs if name.endswith("par")]


def test_a_known_machine_can_set_the_par(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def best_of(*_given: object) -> tuple[float, str]:
        return 60.0, "[known]"

    template = make.content()["items"]["throwing"][0]
    _scores(monkeypatch, floor=0.0, first=10.0, par=40.0)
    monkeypatch.setattr(make, "_best_of", best_of)
    item = make._draw(tmp_path, "throwing-1", template, 0, 8, 1)
    assert (item.par.par, item.machine) == (60.0, "[known]")


def test_gears_that_nobody_found_are_drawn_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They may be impossible: a gear train turns its targets or does not."""
    _scores(monkeypatch, floor=0.0, first=0.0, par=0.0)
    template = make.content()["items"]["gearing"][0]
    with pytest.raises(UsageError, match="nothing in 4 draws scored more than random machines"):
        make._draw(tmp_path, "gearing-1", template, 0, 8, 1)


def test_the_best_of_known_machines_is_verified(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="there is no machine in"):
        make._read_machines(tmp_path)
    for name in ("plain_car", "mast_car", "published_throw"):
        shutil.copy(ROOT / "tests" / "machines" / f"{name}.json", tmp_path)
    machines = make._read_machines(tmp_path)
    assert len(machines) == 3
    task = get_task("movement/3")
    found = asyncio.run(make._best_of(machines, task, 1))
    scores = [verify(m, task).score or 0 for m in machines if check(m, task.brief).task_valid]
    assert scores
    assert found is not None
    assert found[0] == max(scores)
    assert asyncio.run(make._best_of(machines, get_task("gearing"), 1)) is None


def test_a_known_machine_whose_simulation_crashed_sets_no_par(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def crashed(*_given: object, **_named: object) -> SimpleNamespace:
        return SimpleNamespace(score=None)

    monkeypatch.setattr(make.RolloutPool, "run", crashed)
    car = make._read_machines(ROOT / "tests" / "machines" / "movement")[:1]
    with pytest.raises(RunError, match=f"known machine {car[0].digest} timed out or crashed"):
        asyncio.run(make._best_of(car, get_task("movement"), 1))


@pytest.mark.slow
def test_a_new_benchmark_is_continued_and_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    solvers = make.content()["solvers"]
    few = {"settings.max_simulations": 2, "settings.trajectories": 2}
    monkeypatch.setitem(solvers, "floor", {**solvers["floor"], "settings.max_simulations": 3})
    monkeypatch.setitem(solvers, "first", {**solvers["first"], **few})
    monkeypatch.setattr(make, "DRAWS", 1)
    out = tmp_path / "set"
    words = ["new-benchmark", "--out", str(out), "--items", "2", "--simulations", "8"]
    assert main(words) == 0
    content = (out / "set.yaml").read_bytes()
    sweep = read_sweep(load_document(out / "set.yaml"), "set.yaml")
    assert list(sweep.axes["task"]) == ["throwing-1", "movement-1"]
    assert sweep.benchmark is not None
    assert sweep.benchmark.canary.startswith("agentflow-benchmark ")
    assert all(par.par > par.floor for par in sweep.benchmark.pars.values())
    results = {path: path.stat().st_mtime_ns for path in out.glob("making/*/result.json")}
    assert len(results) == 6
    assert main(words) == 0, "nothing is simulated again"
    assert {path: path.stat().st_mtime_ns for path in results} == results
    assert (out / "set.yaml").read_bytes() == content
    with pytest.raises(UsageError, match="is being made with seed 0: continue it with --seed 0"):
        make.make_benchmark(out, seed=1, items=2, simulations=8, say=print)
    known = ROOT / "tests" / "machines"
    with pytest.raises(UsageError, match="is being made without --machines: continue it without"):
        make.make_benchmark(out, items=2, simulations=8, known=known, say=print)

    assert main(["benchmark", str(out / "set.yaml"), "--out", str(tmp_path), "--quiet"]) == 0
    card = read_card(next(tmp_path.glob("set*/card.json")))
    assert card.conditions["engine"].startswith("mujoco")
    assert [item.item for item in card.items] == ["throwing-1", "movement-1"]
    pars = sweep.benchmark.pars
    for item in card.items:
        par = pars[item.item]
        assert item.full == par.par
        for one in (*item.parts["first"], *item.parts["search"]):
            if one.score is not None:
                share = (one.score - par.floor) / (par.par - par.floor)
                assert one.share == pytest.approx(min(1.5, max(0.0, share)), abs=1e-5)
    capsys.readouterr()
    where = str(next(tmp_path.glob("set*/card.json")).parent)
    assert main(["leaderboard", where, "--check", "--benchmark", str(out / "set.yaml")]) == 0
    told = capsys.readouterr().out
    assert "Shares are 0 % at an item's floor and 100 % at its par" in told
    assert "The records were" not in told
    broken = {**load_document(out / "set.yaml")}
    broken["benchmark"]["pars"].pop("movement-1")
    (tmp_path / "broken.yaml").write_text(yaml.safe_dump(broken, sort_keys=False))
    assert main(["benchmark", str(tmp_path / "broken.yaml"), "--dry-run"]) == 2
    assert "movement-1 needs a par above its floor" in capsys.readouterr().err

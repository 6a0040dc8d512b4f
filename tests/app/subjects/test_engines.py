"""The comparison of engines: `agentflow engines`."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agentflow.app.subjects.engines import compare_engines, ranked_families, require_several
from agentflow.cli.display.show_scores import show_engines
from agentflow.env.physics.engines import choose_engine, default_engine
from agentflow.env.physics.registry import ENGINES
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.records import read_records, record_machine
from agentflow.env.tasks.registry import get_task
from agentflow.errors import ConfigError

LEVEL = "movement-1"


def test_one_engine_says_what_to_install() -> None:
    spec = default_engine()
    with pytest.raises(ConfigError) as caught:
        require_several([spec])
    others = [other for other in ENGINES.values() if other is not spec]
    named = " or ".join(f"{other.name} (pip install {other.libraries[0]})" for other in others)
    assert str(caught.value) == (
        f"comparing needs two physics engines, but only {spec.identity} is installed; add {named}"
    )


@pytest.mark.slow
@pytest.mark.pybullet
@pytest.mark.mujoco
def test_records_and_rankings_of_two_engines(capsys: pytest.CaptureFixture[str]) -> None:
    steps: list[tuple[int, int]] = []
    record, machine = read_records()[LEVEL], record_machine(LEVEL)
    assert machine is not None
    found = compare_engines(2, 2, lambda done, of: steps.append((done, of)), {LEVEL: record})
    engines = [str(choose_engine(name).identity) for name in ("pybullet", "mujoco")]
    assert found["engines"] == engines
    (item,) = found["machines"]
    assert (item["machine"], item["task"]) == (LEVEL, "movement")
    for result, name in zip(item["results"], ("pybullet", "mujoco"), strict=True):
        task = replace(get_task("movement"), engine=name)
        rollout = simulate(machine, task, recorded=True)
        assert (result["status"], result["score"]) == ("ok", rollout.score)
        first = min(rollout.broken, key=lambda broken: broken.time, default=None)
        assert result["first_break"] == (first and {"block": first.block, "time": first.time})
    assert item["results"][0]["score"] == pytest.approx(record.score, abs=1e-6)
    assert [family["family"] for family in found["families"]] == list(ranked_families())
    for family in found["families"]:
        assert family["machines"] == 2
        assert [value is None or -1 <= value <= 1 for value in family["correlations"]] == [True]
    total = 2 * (1 + sum(family["machines"] for family in found["families"]))
    assert steps == [(done, total) for done in range(1, total + 1)]
    show_engines(found)
    head, row, *rest = capsys.readouterr().out.splitlines()
    assert head.split()[:5] == ["machine", *engines[0].split(), *engines[1].split()]
    difference = item["results"][1]["score"] - item["results"][0]["score"]
    assert f"{difference:+.2f}" in row.split()
    assert rest[-1] == f"correlations are with {engines[0]}"

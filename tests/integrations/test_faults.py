"""A simulation that crashes is never a score of 0."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from tests.integrations.foreign import CAR, PLUGINS
from tests.llm.foreign import ROOT
from tests.processes import MAIN, run_python

PATHS = f"{ROOT}{os.pathsep}{PLUGINS}"
SCRIPT = """
import json, sys
from agentflow.errors import NoScoreError
from agentflow.integrations.episode import DesignEpisode
from agentflow.rewards import Sample, Scorer
from agentflow.integrations.trl import simulation_reward
from agentflow.integrations.verl import compute_scores

car, tasks = sys.argv[1], ["faulty", "faulty/2"]
rewards = simulation_reward([car, car], tasks, workers=2)
try:
    compute_scores(["machines"] * 2, [car, car], tasks, [{}, {}], workers=2)
except NoScoreError as error:
    refused = str(error)
scorer = Scorer(workers=1)
episode = DesignEpisode(scorer, Sample("faulty/2", ""))
before = episode.machine, episode.score, episode.state
outcome = episode.act(car)
unchanged = before == (episode.machine, episode.score, episode.state)
scorer.close()
seen = outcome.fault, outcome.status, outcome.gain, unchanged
print(json.dumps([rewards, refused, outcome.text.split("\\n## ")[0], seen]))
"""


@pytest.mark.slow
def test_a_crash_is_no_score(tmp_path: Path) -> None:
    done = run_python("-c", SCRIPT, CAR, cwd=tmp_path, PYTHONPATH=PATHS)
    assert done.stderr == ""
    [score, missing], refused, text, seen = json.loads(done.stdout)
    assert score > 1
    assert missing is None
    assert refused == "faulty/2: No score: the simulation was cut off, its process died 3 times."
    assert text == (
        "The machine is unchanged.\n"
        "No score: the simulation was cut off, its process died 3 times.\n"
    )
    assert seen == [True, "crashed", 0.0, True]


@pytest.mark.slow
def test_a_family_that_crashes_or_hangs_does_so_in_a_worker(tmp_path: Path) -> None:
    (tmp_path / "car.json").write_text(CAR)
    command = ("-c", MAIN, "simulate", "car.json", "--task", "faulty/2", "--json")
    done = run_python(*command, cwd=tmp_path, PYTHONPATH=PATHS)
    assert done.stderr == ""
    assert json.loads(done.stdout)["status"] == "crashed"

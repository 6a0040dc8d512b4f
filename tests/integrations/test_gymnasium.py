"""Gymnasium, as installed: its registry, its checker of environments, its vector environments."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from agentflow.env.tasks.registry import FAMILIES
from tests.integrations.foreign import CAR, PLUGINS, documented_code, offer_examples, run_foreign

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

ENVIRONMENT = ".venv-gymnasium"
BEGIN = """
import json, sys, warnings
warnings.simplefilter("error")
import gymnasium
import agentflow
import agentflow.integrations.gymnasium
"""
CHECK = """
from gymnasium.utils.env_checker import check_env

for spec in [spec for spec in gymnasium.registry.values() if spec.namespace == "agentflow"]:
    environment = spec.make(render_mode="rgb_array")
    check_env(environment.unwrapped)
    environment.close()
    print(spec.id)
"""
DESIGN = """
car = sys.argv[1]
environment = gymnasium.make("agentflow/movement-v0", level=2, knobs={"window": 2})
scores, direct = [], []
for changed in ({}, {"window": 1}, {}):
    observation, info = environment.reset(options={"knobs": changed})
    first = info["score"]
    observation, gain, terminated, truncated, info = environment.step(car)
    assert not terminated and not truncated
    assert observation in environment.observation_space
    scores.append(first + gain)
    knobs = {"window": 2, **changed}
    direct.append(agentflow.reward("movement/2", car, knobs=knobs).value)
assert "caf?" in environment.step("Add 2 to caf\\u00e9")[0]
environment.close()
print(json.dumps([scores, direct]))
"""
SEEDS = """
from agentflow.env.tasks.registry import get_task

environment = gymnasium.make("agentflow/jumping-v0")
root = get_task("jumping").brief.given.to_text()
texts = [environment.reset(seed=seed)[0] for seed in (3, None, None, 4, 3, None)]
direct = [agentflow.reward("jumping", root, seed=seed).rollout.feedback.text for seed in (3, 4)]
environment.close()
assert texts[0] == texts[4] and texts[1] == texts[5]
assert len(set(texts)) == 4
assert direct[0] in texts[0] and direct[1] in texts[3]
"""
ERRORS = """
environment = gymnasium.make("agentflow/movement-v0")
raw = environment.unwrapped
for call in (
    lambda: environment.reset(options={"wet": 1}),
    lambda: environment.reset(options={"knobs": {"wet": 1}}),
    lambda: environment.reset(options={"knobs": 8}),
    lambda: type(raw)("movement", render_mode="human"),
    lambda: raw.step("Remove 1"),
):
    try:
        call()
    except (agentflow.errors.UsageError, gymnasium.error.ResetNeeded) as error:
        print(str(error).split(" (1 to")[0])
environment.close()
"""
FAULT = """
car = sys.argv[1]
environment = gymnasium.make("agentflow/faulty-v0", level=2)
environment.reset(seed=0)
observation, reward, terminated, truncated, info = environment.step(car)
assert observation.startswith("The machine is unchanged.\\nNo score: ")
assert len(json.loads(info["machine"])) == 1
print(json.dumps([reward, terminated, truncated, info["fault"], info["status"]]))
try:
    environment.reset(options={"start": car})
except agentflow.errors.NoScoreError as error:
    print(error)
environment.close()
"""
VECTOR = """
car = sys.argv[1]
for mode, options in {"sync": {}, "async": {"shared_memory": False}}.items():
    environments = gymnasium.make_vec(
        "agentflow/movement-v0", 2, mode, vector_kwargs=options, knobs={"window": 1}
    )
    environments.reset(seed=[0, 0])
    observations, rewards, *_, infos = environments.step((car, "Add 15 to 0 in 4"))
    assert rewards[0] > 1 > rewards[1]
    assert infos["status"].tolist() == ["ok", "ok"]
    assert "## Simulation feedback" in observations[0]
    environments.close()
"""


def test_every_environment_passes_the_check(tmp_path: Path) -> None:
    printed = run_foreign(ENVIRONMENT, tmp_path, "-c", BEGIN + CHECK)
    assert printed.split() == [f"agentflow/{name}-v0" for name in FAMILIES.ours]


def test_scores_are_those_of_the_simulation_and_seeds_those_of_the_trials(tmp_path: Path) -> None:
    printed = run_foreign(ENVIRONMENT, tmp_path, "-c", BEGIN + DESIGN + SEEDS, CAR)
    scores, direct = json.loads(printed)
    assert scores == pytest.approx(direct, abs=1e-9)
    assert scores[0] == scores[2] > scores[1] > 1


def test_what_does_not_exist_is_an_error(tmp_path: Path) -> None:
    assert run_foreign(ENVIRONMENT, tmp_path, "-c", BEGIN + ERRORS).splitlines() == [
        "unknown option 'wet'; known: knobs, start",
        "unknown knob 'wet' of movement; known: window",
        "knobs must be a mapping such as {\"wind.speed\": 8}, or JSON text of one, not '8'",
        "unknown render mode 'human'; known: rgb_array",
        "call reset() before step() or render()",
    ]


def test_a_fault_truncates_the_episode_and_earns_nothing(tmp_path: Path) -> None:
    plugins = {"PYTHONPATH": str(PLUGINS)}
    printed = run_foreign(ENVIRONMENT, tmp_path, "-c", BEGIN + FAULT, CAR, variables=plugins)
    step, reset = printed.splitlines()
    assert json.loads(step) == [0.0, False, True, "crashed", "crashed"]
    assert reset.startswith("faulty/2: No score: the simulation was cut off, ")


def test_environments_run_side_by_side(tmp_path: Path) -> None:
    run_foreign(ENVIRONMENT, tmp_path, "-c", BEGIN + VECTOR, CAR)


def test_the_documented_code_runs(tmp_path: Path) -> None:
    offer_examples(tmp_path)
    run_foreign(ENVIRONMENT, tmp_path, "-c", documented_code("gymnasium"))

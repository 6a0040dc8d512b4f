"""The same machine has the same reward on every path, bit for bit."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import agentflow
from agentflow.cli import main
from agentflow.integrations.harbor import export, items_of
from agentflow.integrations.trl import bench_environment, simulation_reward
from agentflow.integrations.verl import compute_score
from agentflow.runs import read_result
from tests.conftest import stub_server
from tests.integrations.foreign import CAR, run_foreign
from tests.integrations.test_harbor import read_reward, run_script
from tests.integrations.test_verifiers import play
from tests.llm.foreign import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.mujoco, pytest.mark.timeout(600)]

NAME = "6c45a9a7"
"""What the tools call the car."""
ENGINE = "mujoco"
FOREIGN = {
    "openenv": """
from agentflow.integrations.openenv import BenchAction, BenchEnvironment
from agentflow.integrations.session import Benches
environment = BenchEnvironment(Benches("OpenEnv", engine="mujoco"))
environment.reset(task="movement")
environment.step(BenchAction(tool="check", arguments={"machine": CAR}))
found = environment.step(BenchAction(tool="submit", arguments={"machine": "6c45a9a7"})).reward
environment.close()
""",
    "inspect": """
from inspect_ai import eval
from inspect_ai.model import ModelOutput, ModelUsage, get_model
output = ModelOutput.from_content("mockllm", CAR)
output.usage = ModelUsage()
model = get_model("mockllm/model", custom_outputs=[output])
given = {"task_args": {"engine": "mujoco"}, "limit": 1, "display": "none"}
[log] = eval("agentflow/movement", model=model, **given)
found = log.samples[0].scores["simulation"].value["score"]
""",
    "gymnasium": """
import gymnasium
import agentflow.integrations.gymnasium
environment = gymnasium.make("agentflow/movement-v0", engine="mujoco")
environment.reset(seed=0)
found = environment.step(CAR)[-1]["score"]
environment.close()
""",
    "evolution": """
from gepa.optimize_anything import EngineConfig, GEPAConfig, ReflectionConfig, optimize_anything
import agentflow
config = GEPAConfig(
    engine=EngineConfig(max_metric_calls=1),
    reflection=ReflectionConfig(reflection_lm=lambda prompt: CAR),
)
evaluator = agentflow.evaluator("movement", engine="mujoco", workers=1)
found = optimize_anything(CAR, evaluator=evaluator, config=config).val_aggregate_scores[0]
""",
}
"""Environment of a library -> code that finds the reward of CAR there."""
SETTINGS = ("engine=mujoco", "verify=false", "workers=1")


def test_every_path_gives_the_same_reward(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "machine.json").write_text(CAR)
    expected = agentflow.reward("movement", CAR, engine=ENGINE).value
    found = {"simulate": agentflow.simulate(json.loads(CAR), "movement", engine=ENGINE).score}

    command = ["simulate", "machine.json", "--task", "movement", "--engine", ENGINE, "--json"]
    assert main(command) == 0
    found["command"] = json.loads(capsys.readouterr().out)["score"]

    settings = [word for setting in SETTINGS for word in ("--set", setting)]
    assert main(["bench", "start", "--task", "movement", "--name", "car", *settings]) == 0
    assert main(["bench", "check", "@machine.json"]) == 0
    assert main(["bench", "submit", NAME]) == 0
    found["shell"] = read_result(tmp_path / "runs" / "car").score

    export(items_of(["movement"]), tmp_path, engine=ENGINE)
    test = tmp_path / "movement-1" / "tests" / "test.sh"
    assert run_script(test, tmp_path, tmp_path / "logs").returncode == 0
    found["harbor"] = read_reward(tmp_path / "logs")["reward"]

    evaluator = agentflow.evaluator("movement", engine=ENGINE, workers=1)
    found["gepa"] = evaluator(CAR)[0]
    found["openevolve"] = evaluator.evaluate("machine.json")["metrics"]["combined_score"]

    [found["trl"]] = simulation_reward([CAR], "movement", engine=ENGINE, workers=1)
    found["verl"] = compute_score("machines", CAR, "movement", engine=ENGINE)["score"]
    environment = bench_environment(engine=ENGINE, workers=1)()
    environment.reset(task="movement")
    environment.check(machine=CAR)
    environment.submit(machine=NAME)
    found["tools"] = environment.get_reward()

    evaluator.write("machine.json", tmp_path)
    found["shinkaevolve"] = json.loads((tmp_path / "metrics.json").read_text())["combined_score"]
    for name, code in FOREIGN.items():
        program = f"import sys\nCAR = sys.argv[1]{code}print('\\n', found, sep='')"
        found[name] = float(run_foreign(f".venv-{name}", tmp_path, "-c", program, CAR).split()[-1])
    replies = [{"name": "car", "match": {}, "response": {"content": f"A car:\n{CAR}"}}]
    (tmp_path / "replies.json").write_text(json.dumps({"fixtures": replies}))
    with stub_server(tmp_path / "replies.json") as url:
        [trace] = play(tmp_path, url, "movement/1")
    found["verifiers"] = trace["rewards"]["simulated_score"]["score"]

    assert found == dict.fromkeys(found, expected)
    assert len(found) == 15
    page = (ROOT / "docs" / "how-to" / "libraries.md").read_text(encoding="utf-8")
    shown = re.findall(r"(?m) (\d+\.\d+) \|$", page)
    assert len(shown) == 12
    assert list(map(float, shown)) == pytest.approx([expected] * 12, abs=1e-6)

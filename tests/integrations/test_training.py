"""TRL and verl, as installed: they train on what simulations score.

Optional: `scripts/servers training` makes its environment, which CI does where PyTorch is small.
"""

from __future__ import annotations

import json
import re
from math import isnan
from pathlib import Path

import pytest

import agentflow
from tests.integrations.foreign import CAR, PLUGINS, documented_code, run_foreign
from tests.llm.foreign import ROOT

ENVIRONMENT = ".venv-training"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(600),
    pytest.mark.skipif(
        not (ROOT / ENVIRONMENT / "bin" / "python").exists(),
        reason=f"{ENVIRONMENT} is missing: run scripts/servers training",
    ),
]

OFFLINE = {"PYTHONPATH": str(PLUGINS), "HF_HUB_OFFLINE": "1", "OMP_NUM_THREADS": "1"}


def documented_overrides() -> list[str]:
    """The configuration in the documented command of verl."""
    page = (ROOT / "docs" / "integrations" / "verl.md").read_text(encoding="utf-8")
    [overrides] = re.findall(r"(?m)^python -m verl\.trainer\.main_ppo (.+)$", page)
    return overrides.split()


@pytest.mark.mujoco
def test_trl_learns_from_scores_and_not_from_crashes(tmp_path: Path) -> None:
    variables = {**OFFLINE, "TRL_EXPERIMENTAL_SILENCE": "1"}
    script = Path(__file__).with_name("trl_training.py")
    codes = documented_code("trl", 0), CAR, documented_code("trl", 1)
    # -P: beside the script is a package `mcp`
    printed = run_foreign(ENVIRONMENT, tmp_path, "-P", script, *codes, variables=variables)
    found = json.loads(printed.splitlines()[-1])

    steps = [row for row in found["trained"] if "reward" in row]
    assert [row["step"] for row in steps] == [1, 2]
    assert [row["rewards/simulation_reward/mean"] for row in steps] == [0.0, 0.0]

    steps = [row for row in found["with_tools"] if "reward" in row]
    assert [row["rewards/Bench/mean"] for row in steps] == [0.0]  # of the last of two, by default
    assert found["designed"] == [agentflow.reward("movement", CAR, engine="mujoco").value, None]

    score = found["score"]
    assert score > 1
    first, crashed, nothing, last = found["rewards"]
    assert [first, nothing, last] == pytest.approx([score, 0.0, score])
    assert isnan(crashed)
    step = found["taught"][0]
    assert step["reward"] == pytest.approx(2 / 3 * score)  # the mean of three, not of four
    assert step["grad_norm"] > 0
    advantages = found["advantages"]
    assert advantages[1] == 0.0
    assert advantages[0] == advantages[3] > 0 > advantages[2]
    assert sum(advantages) == pytest.approx(0, abs=1e-3)


def test_verl_gets_scores_and_an_error_for_a_crash(tmp_path: Path) -> None:
    script = Path(__file__).with_name("verl_rewards.py")
    arguments = (documented_code("verl"), json.dumps(documented_overrides()), CAR)
    printed = run_foreign(ENVIRONMENT, tmp_path, script, *arguments, variables=OFFLINE)
    found = json.loads(printed.splitlines()[-1])

    score = found["score"]
    assert score > 1
    parts = {"parsed": 1.0, "spatial": 1.0, "valid": 1.0}
    assert found["single"] == [
        {"reward_score": value, "reward_extra_info": {"score": value, **part}}
        for value, part in ((score, parts), (0.0, dict.fromkeys(parts, 0.0)))
    ]
    for manager in ("naive", "batch", "loop"):
        assert found[manager] == pytest.approx([score, 0.0])
    assert found["valid"] == [1.0, 0.0]

    assert len(found["faults"]) == 4
    for fault in found["faults"]:
        assert "faulty/2: No score: the simulation was cut off, its process died 3 times." in fault
    assert found["expected"] > 1
    assert found["learned"] == pytest.approx({"row_0_0": found["expected"], "row_2_0": 0.0})

"""Check, simulate and score a machine, and compute the reward of a model's reply for training."""

from pathlib import Path

import agentflow

CAR = Path(__file__).parent / "car.json"

report = agentflow.check(CAR, task="movement")
print("valid:", report.task_valid)

rollout = agentflow.simulate(CAR, "movement")
print(f"drives {rollout.score:.1f} m; the digest is always {rollout.digest}")

calm = agentflow.simulate(CAR, "movement", power=False)
print(f"with power off {calm.score:.1f} m")

windy = agentflow.simulate(CAR, "movement", knobs={"wind.speed": 1})
print(f"against a wind of 1 m/s {windy.score:.1f} m")

for reply in (f"Four wheels will do:\n```json\n{CAR.read_text()}\n```", "I would build a car."):
    reward = agentflow.reward("movement", reply)
    why = "; ".join(problem.code for problem in reward.problems)
    print(f"reward {reward.value:.1f}, parsed {reward.parsed}, valid {reward.valid} {why}")

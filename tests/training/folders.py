"""Small evaluations and training runs on disk, with real machines and their real scores."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from pydantic import BaseModel

from agentflow.llm.messages import Sampling
from agentflow.rewards import Sample, Scorer
from agentflow.training.evaluation.record import EvaluationRecord, open_evaluation
from agentflow.training.evaluation.replies import JudgedReply, judge
from agentflow.training.record import About, TrainingRun
from tests.integrations.foreign import CAR
from tests.llm.foreign import ROOT

LABEL = "tiny model from scratch, procedural data"
THROWERS = ("springy_throw", "thrower_short_arm", "thrower_long_arm")
NOTHING = "Sorry, I cannot."


class Config(BaseModel):
    """A configuration of training, as far as readers look at it."""

    tasks: tuple[str, ...] = ("throwing",)
    seed: int = 0


def throws() -> tuple[JudgedReply, ...]:
    """Three machines that throw, from bad to good, and a reply without a machine."""
    return _judged()[:4]


def drives() -> tuple[JudgedReply, ...]:
    """A car, and a reply without a machine."""
    return _judged()[4:]


@cache
def _judged() -> tuple[JudgedReply, ...]:
    files = [ROOT / "tests" / "machines" / f"{name}.json" for name in THROWERS]
    throwers = [f"A thrower.\n```json\n{path.read_text()}\n```" for path in files]
    samples = [Sample("throwing", text) for text in (*throwers, NOTHING)]
    samples += [Sample("movement", text) for text in (f"A car.\n```json\n{CAR}\n```", NOTHING)]
    scorer = Scorer(workers=2)
    try:
        return tuple(judge(samples, scorer))
    finally:
        scorer.close()


def write_evaluation(
    folder: Path,
    name: str,
    replies: Sequence[JudgedReply],
    *,
    finished: bool = True,
    **fields: object,
) -> Path:
    """An evaluation with these replies, as many to each task."""
    tasks = tuple(dict.fromkeys(reply.task for reply in replies))
    about = {
        "name": name,
        "model": f"models/{folder.name}",
        "label": LABEL,
        "tasks": tasks,
        "samples": len(replies) // len(tasks) + (not finished),
        "seed": 0,
        "sampling": Sampling(temperature=1.0, top_p=1.0),
        "prompts": "default 0123456789abcdef",
        "conditions": {"constants": "0", "blocks": "0", "engine": "pybullet 3.2.7"},
    }
    with open_evaluation(folder, EvaluationRecord.model_validate(about | fields)) as found:
        found.add(list(replies))
        if finished:
            found.finish()
    return folder


def write_training(folder: Path, label: str = LABEL, steps: int = 6) -> Path:
    """A run of reinforcement learning: a line for each step, samples after every third."""
    with TrainingRun.open(folder, About(kind="grpo", label=label), Config(), resume=False) as run:
        for step in range(1, steps + 1):
            run.note(step, {"reward_mean": step / 2, "valid": 0.5 + step / 20, "kl": 0.01 * step})
            if step % 3 == 0:
                valid = {"count": 3, "of": 4, "share": 0.75}
                run.note(
                    step, {"eval": {"throwing": {"valid": valid, "best_at": {"2": 3.5 + step / 2}}}}
                )
                run.samples(step, [*throws(), *throws()[: step // 3]])
        run.finish({"model": "model", "steps": steps})
    return folder

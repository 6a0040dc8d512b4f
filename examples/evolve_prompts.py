"""Let GEPA evolve the advice that designers read, on items of the benchmark.

    pip install gepa
    python examples/evolve_prompts.py --model NAME --base-url URL

The candidate is a text that ends the designer's system prompt. An evaluation is one reply to one
item; its share of the par counts. Items for training and unseen ones are of other
families. Without `--model`, a stand-in answers whose best advice is known: the more of what it
needs it reads in the advice, the better is the car that it builds. It shows that the loop works,
and nothing about models.
"""

import argparse
import json
import os
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import httpx
from gepa.optimize_anything import EngineConfig, GEPAConfig, ReflectionConfig, optimize_anything

import agentflow
from agentflow.app.benchmark.plan import item_configs, plan_benchmark, read_items

TRAIN = ("movement-1", "movement-2")
UNSEEN = ("delivery-1", "delivery-2")
SEED_ADVICE = "Think before you build."
NEEDED = ("powered wheels", "four wheels", "no ballast")
"""What the stand-in needs to read, of which the best advice has all."""
CAR = json.loads((Path(__file__).parent / "car.json").read_text())


def stand_in(messages: list[dict[str, str]]) -> str:
    """A model with a known optimum: it follows the advice and nothing else."""
    advice = messages[0]["content"].rpartition("## Advice\n")[2]
    driven, four, light = (words in advice for words in NEEDED)
    steps = CAR[: 7 if driven and four else 5 if driven else 3]
    ballast = {"type": 35, "id": len(steps), "parent": 0, "face_id": 4}
    return json.dumps(steps if light else [*steps, ballast])


def stand_in_reflection(prompt: str) -> str:
    """Adds one piece of advice that the current one lacks."""
    current = prompt[prompt.index(SEED_ADVICE) :].partition("\n```")[0]
    missing = [words for words in NEEDED if words not in current]
    return f"```\n{current} Build with {missing[0]}.\n```" if missing else f"```\n{current}\n```"


class Endpoint:
    """A model at an OpenAI-compatible endpoint."""

    def __init__(self, model: str, base_url: str) -> None:
        self.model, self.url = model, f"{base_url.rstrip('/')}/chat/completions"

    def __call__(self, asked: str | list[dict[str, str]]) -> str:
        messages = [{"role": "user", "content": asked}] if isinstance(asked, str) else asked
        head = {"Authorization": f"Bearer {os.environ.get('OPENAI_API_KEY', '')}"}
        body = {"model": self.model, "messages": messages}
        reply = httpx.post(self.url, headers=head, json=body, timeout=600).raise_for_status()
        return str(reply.json()["choices"][0]["message"]["content"])


class Items:
    """Items of the benchmark, and what a reply to one is worth under some advice."""

    def __init__(self, answer: Callable[[list[dict[str, str]]], str], engine: str) -> None:
        sweep = plan_benchmark(Path("benchmark"), (), {}).sweep
        self.items, self.configs = read_items(sweep), item_configs(sweep)
        self.answer, self.engine, self.evaluations = answer, engine, 0

    def evaluate(self, advice: str, example: str) -> tuple[float, dict]:
        """What GEPA calls: the share of the par, and what happened."""
        self.evaluations += 1
        config = self.configs[example]
        given = {"knobs": config.knobs, "engine": self.engine}
        with TemporaryDirectory() as prompts:
            write_prompts(Path(prompts), advice)
            reply = self.answer(agentflow.design_prompt(config.task, prompts=prompts, **given))
        score, told = agentflow.evaluator(config.task, workers=1, **given)(reply)
        share = self.items[example].share(score)
        return share, {**told, "Item": example, "scores": {"share": share}}

    def mean_share(self, advice: str, names: tuple[str, ...]) -> float:
        return sum(self.evaluate(advice, name)[0] for name in names) / len(names)


def write_prompts(folder: Path, advice: str) -> None:
    """A prompt set that differs from the default one in the end of the designer's system prompt.

    The advice is a string in the template, so that nothing in it is carried out.
    """
    own = Path(agentflow.__file__).parent / "prompts" / "default" / "designer" / "system.j2"
    (folder / "designer").mkdir()
    text = f"{own.read_text()}\n\n## Advice\n{{{{ {json.dumps(advice)} }}}}\n"
    (folder / "designer" / "system.j2").write_text(text)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model")
    parser.add_argument("--base-url", default="https://api.openai.com/v1")
    parser.add_argument("--evaluations", type=int, default=30)
    parser.add_argument("--engine", default="mujoco")
    given = parser.parse_args()
    model = Endpoint(given.model, given.base_url) if given.model else None
    items = Items(model or stand_in, given.engine)
    before = items.mean_share(SEED_ADVICE, UNSEEN)
    seen = items.evaluations
    found = optimize_anything(
        SEED_ADVICE,
        evaluator=items.evaluate,
        dataset=list(TRAIN),
        objective="Advice with which a designer's machines score as high as possible.",
        config=GEPAConfig(
            engine=EngineConfig(max_metric_calls=given.evaluations, seed=0),
            reflection=ReflectionConfig(reflection_lm=model or stand_in_reflection),
        ),
    )
    evaluations = items.evaluations - seen
    after = items.mean_share(found.best_candidate, UNSEEN)
    print(f"advice after {evaluations} evaluations: {found.best_candidate}")
    print(f"mean share on unseen items: {before:.3f} before, {after:.3f} after")


if __name__ == "__main__":
    main()

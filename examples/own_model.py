"""Run a workflow with a model function of your own: here one that always proposes the same car.

Put a call of your model in place of `answer`; it gets the messages of a chat and gives a text. It
may be a coroutine function. Everything else (retries, record, replay) is as for any model.
"""

import json
import tempfile
from pathlib import Path

import agentflow

CAR = json.loads((Path(__file__).parent / "car.json").read_text())


def answer(request: agentflow.Request) -> str:
    """Answer one request; `request.role` is designer, refiner, ..."""
    prompt = request.messages[-1].text
    print(f"{request.label}: a prompt of {len(prompt)} characters")
    return f"A car.\n```json\n{json.dumps(CAR)}\n```"


with tempfile.TemporaryDirectory() as folder:
    design = agentflow.design(
        "movement",
        workflow="single",
        answer=answer,
        model="always the same car",
        settings={"trajectories": 2, "search.rounds": 0},
        out=folder,
    )
    print(f"{design.model}: {design.score:.1f} m with {len(design.machine)} blocks")
    print(f"kept in {design.run.name}:", *sorted(path.name for path in design.run.iterdir()))

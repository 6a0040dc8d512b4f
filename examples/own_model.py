"""Run a workflow with your own model function; this one always proposes the same car.

Replace the body of `answer` with a call to your model: it receives the messages of a chat and
returns text, and may be async. Retries, recording and replay work as for any model.
"""

import json
import tempfile
from pathlib import Path

import agentflow

CAR = json.loads((Path(__file__).parent / "car.json").read_text())


def answer(request: agentflow.Request) -> str:
    """Answer one request; `request.role` is designer, refiner, ..."""
    prompt = request.messages[-1].text
    print(f"{request.label}: a prompt of {len(prompt)} characters\n", end="")  # two threads print
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
    print(f"saved in {design.run.name}:", *sorted(path.name for path in design.run.iterdir()))

"""What a command does not need it does not load: starting takes no longer than it must.

The times themselves are measured by benchmarks/start.py.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

CAR = Path(__file__).parents[2] / "examples" / "car.json"
PHYSICS = {"numpy", "pybullet", "PIL", "scipy"}
MODELS = {"httpx", "jinja2", "tenacity", "asyncio"}
CODE = """
import contextlib, io, sys
from agentflow.cli import main
with contextlib.redirect_stdout(io.StringIO()):
    assert main(sys.argv[1:]) == 0
print(*{name.partition(".")[0] for name in sys.modules})
"""


@pytest.mark.parametrize(
    ("arguments", "unwanted"),
    [
        (["--help"], {*PHYSICS, *MODELS, "pydantic", "yaml", "rich"}),
        (["--version"], {*PHYSICS, *MODELS, "pydantic", "yaml", "rich"}),
        (["check", str(CAR)], {*PHYSICS, *MODELS, "yaml", "statsmodels"}),
        (["check", str(CAR), "--json"], {*PHYSICS, *MODELS, "yaml", "statsmodels"}),
        (["failures", "--help"], {*PHYSICS, *MODELS, "yaml", "statsmodels"}),
        (["tasks"], {"pybullet", "PIL", "jinja2", "scipy", "statsmodels"}),
    ],
)
def test_heavy_modules_stay_out(arguments: list[str], unwanted: set[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-c", CODE, *arguments], capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.split())
    assert "agentflow" in loaded
    assert not loaded & unwanted

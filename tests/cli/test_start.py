"""What a command does not need it does not load: starting takes no longer than it must.

The times themselves are measured by benchmarks/start.py.
"""

from __future__ import annotations

from pathlib import Path

from tests.processes import run_python

CAR = Path(__file__).parents[2] / "examples" / "car.json"
PHYSICS = {"numpy", "pybullet", "PIL", "scipy"}
MODELS = {"httpx", "jinja2", "tenacity", "asyncio", "mcp", "uvicorn"}
CODE = """
import contextlib, io, shlex, sys
from agentflow.cli import main
for line in sys.argv[1:]:
    with contextlib.redirect_stdout(io.StringIO()):
        assert main(shlex.split(line)) == 0
    print(*{name.partition(".")[0] for name in sys.modules})
"""
UNWANTED = {
    "--help": {*PHYSICS, *MODELS, "pydantic", "yaml", "rich", "statsmodels"},
    "--version": {*PHYSICS, *MODELS, "pydantic", "yaml", "rich", "statsmodels"},
    f"check {CAR}": {*PHYSICS, *MODELS, "yaml", "statsmodels"},
    f"check {CAR} --json": {*PHYSICS, *MODELS, "yaml", "statsmodels"},
    "failures --help": {*PHYSICS, *MODELS, "yaml", "statsmodels"},
    "tasks": {*MODELS - {"jinja2"}, "pybullet", "PIL", "scipy", "statsmodels"},
}
"""Fewer and fewer, because each command finds loaded what those before it needed."""


def test_heavy_modules_stay_out() -> None:
    lines = run_python("-c", CODE, *UNWANTED).stdout.splitlines()
    for (command, unwanted), line in zip(UNWANTED.items(), lines, strict=True):
        assert "agentflow" in line.split()
        assert not {*line.split()} & unwanted, command

"""Options and arguments that several commands have: one declaration and one help text for each.

Choices come from the registry or the type that owns them, if that loads almost nothing; where it
loads much, `tests/cli/test_choices.py` compares them.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from agentflow.app.pools import Where
from agentflow.app.sweeps.registry import VIEWS as SWEEP_VIEWS
from agentflow.env.physics.registry import ENGINES
from agentflow.metrics.tables import FORMATS
from agentflow.training.views import VIEWS as TRAINING_VIEWS

TASK = "Task, such as throwing or movement/3."
SET_KNOB = "Set a knob (an adjustable parameter of the task), knob=value; repeatable."
WORKERS = "Worker processes for simulation."

if TYPE_CHECKING:
    FormatName = str
    FormatOrJsonName = str
    ViewName = str
else:  # typer offers and checks the members of a Literal; type checkers cannot compute one
    FormatName = Literal[tuple(name for name in FORMATS if name != "json")]
    FormatOrJsonName = Literal[tuple(FORMATS)]
    ViewName = Literal[tuple(dict.fromkeys((*SWEEP_VIEWS, *TRAINING_VIEWS)))]

# what is worked on
Run = Annotated[Path, typer.Argument(help="Run directory.")]
MachineOrRun = Annotated[
    str,
    typer.Argument(help="Machine file, run directory (its best machine), or - for standard input."),
]
Lines = Annotated[bool, typer.Option("--jsonl", help="Read one machine per line.")]
Task = Annotated[str | None, typer.Option("--task", help=TASK)]
NamedTask = Annotated[str, typer.Option("--task", help=TASK)]
Knobs = Annotated[list[str] | None, typer.Option("--set", help=SET_KNOB)]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Set a configuration key or a knob (an adjustable parameter of the task), "
        "key=value; repeatable.",
    ),
]
Config = Annotated[Path | None, typer.Option("--config", help="YAML configuration file.")]

# who answers
ModelName = Annotated[
    str | None,
    typer.Option(
        "--model",
        help="Model name (default: AGENTFLOW_MODEL, else procedural: rules and random choices).",
    ),
]
BaseUrl = Annotated[
    str | None,
    typer.Option(
        "--base-url",
        help="URL of an OpenAI-compatible endpoint (default: OPENAI_BASE_URL). Its key is read "
        "from OPENAI_API_KEY.",
    ),
]
Trust = Annotated[
    bool,
    typer.Option(
        "--trust",
        help="Send prompts and keys to the endpoints that the given file or directory names, and "
        "run the program that it names, even if you have not named them yourself.",
    ),
]

# how it is simulated
Engine = Annotated[
    str | None,
    typer.Option(
        "--engine",
        help=f"Physics engine: auto (the first that is installed), {' or '.join(ENGINES.ours)}.",
    ),
]
Seed = Annotated[int, typer.Option("--seed", help="Random seed.")]
RunSeed = Annotated[int | None, typer.Option("--seed", help="Random seed (default: 0).")]
Workers = Annotated[int, typer.Option("--workers", min=1, help=WORKERS)]
Backend = Annotated[
    Where,
    typer.Option(
        "--backend",
        help="Where to simulate: local (worker processes on this computer) or ray (a Ray cluster: "
        "the one at RAY_ADDRESS, else one on this computer).",
    ),
]

# how many runs
Jobs = Annotated[
    int,
    typer.Option(
        "--jobs", min=1, help="Number of runs to execute concurrently; they share the workers."
    ),
]
SharedWorkers = Annotated[
    int | None, typer.Option("--workers", help="Worker processes, shared by all runs.")
]
ResumeRuns = Annotated[bool, typer.Option("--resume", help="Resume unfinished and failed runs.")]
DryRun = Annotated[bool, typer.Option("--dry-run", help="List the runs and estimate their cost.")]

# what is written
RunsFolder = Annotated[Path, typer.Option("--out", help="Parent directory for runs.")]
Format = Annotated[FormatName, typer.Option("--format", help="Output format.")]
FormatOrJson = Annotated[FormatOrJsonName, typer.Option("--format", help="Output format.")]
Published = Annotated[
    bool,
    typer.Option("--published", help="Add the published values of other models as separate rows."),
]
Json = Annotated[bool, typer.Option("--json", help="Print only JSON to stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Suppress progress and notices.")]

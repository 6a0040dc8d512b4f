"""Training, its data and evaluations as text for people; programs use --json."""

from collections.abc import Callable

from agentflow.cli.display.output import Data, Field, field, table, tell
from agentflow.metrics.tables import interval_text, number, percent

EVALUATED = (
    field("task"),
    Field("valid", lambda row: f"{row['valid']['count']}/{row['valid']['of']}"),
    Field("share", lambda row: percent(row["valid"]["share"])),
    Field("95 %", lambda row: interval_text(row["valid"]["interval"], 1, in_percent=True)),
    field("mean", show=number),
    field("95 %", "mean_interval", interval_text),
    field("SD", "sd", number),
    field("max", show=number),
)
GATE = (
    field("gate"),
    field("machines before", "entered"),
    field("after", "passed"),
    field("passes if", "passes"),
)


def show_evaluation(found: Data) -> None:
    """Print the numbers of each task."""
    tell(f"{found['name']}: {found['label']}, {found['conditions']['engine']}")
    rows = [{"task": task, **row} for task, row in found["results"].items()]
    tell(table(EVALUATED, rows))
    counts = dict.fromkeys(n for row in rows for n in row["best_at"])
    tell(table((field("task"), *(Field(f"Best@{n}", _best_at(n)) for n in counts)), rows))
    for row in rows:
        if row["faults"]:
            tell(
                f"{row['task']}: {row['faults']} left out because their simulation crashed or "
                "timed out"
            )


def _best_at(count: object) -> Callable[[Data], str]:
    return lambda row: number(row["best_at"].get(count))


def show_training(result: Data) -> None:
    """Print where the trained model is, and how to use it."""
    print(f"{result['label']}: {result['steps']} steps in {number(result['seconds'])} s")
    if result.get("dev_loss") is not None:
        print(f"loss on dev.jsonl: {number(result['dev_loss'])}")
    print(f"model: {result['model']}")
    print(f"design with it: agentflow design --task throwing --model {result['model']}")


def show_answers(found: Data) -> None:
    """Print how many answers to objectives are recorded, and what ended the work early."""
    variants = f" and {found['variants']} variants" * bool(found["variants"])
    tell(
        f"{found['answers']} of {found['planned']} answers{variants} of {found['model']}: "
        f"{found['out']}"
    )
    if found["stopped"]:
        tell(f"stopped: {found['stopped']}")


def show_card(found: Data) -> None:
    """Print how many machines passed each gate of a data set."""
    pairs = found["pairs"]
    tell(table(GATE, found["gates"]), wide=True)
    tell(
        f"{pairs['train']} pairs to train and {pairs['dev']} to measure ({found['model']}): "
        f"{found['out']}"
    )

"""Results as text for people; programs use --json."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from typing import Any

from rich.text import Text

from agentflow.cli.display.output import columns, output
from agentflow.cli.display.text import block_count, number

Data = Mapping[str, Any]
VALID = ("valid at once", "after retries")
"""Headers of the counts of machines that were valid at the first attempt, and after retries."""
FRONT = 10
"""Most machines of a Pareto front that are printed; the data holds all."""
MARGINAL = 3
"""Most marginal connections that are printed; the data holds all."""


def show_result(result: Data, pictures: Mapping[str, str]) -> None:
    """Print the result of a design run: score, stages, model, cost, paths."""
    console = output()
    if seeds := result.get("seeds"):
        _show_seeds(seeds)
    if result["valid"]:
        count = result.get("blocks") or len(result["machine"])  # older results lack the count
        blocks = block_count(count, result.get("most_blocks"))
        console.print(
            f"best score {number(result['score'])} ({result['task']}), "
            f"{blocks}, found in stage {result['best_stage']}"
        )
    if verified := result.get("verified"):
        console.print(verified_line(verified))
    show_objectives(result)
    table = columns("stage", *VALID, "mean", "best")
    for row in result["stages"]:
        counts = (f"{row[key]}/{row['trajectories']}" for key in ("valid_first", "valid"))
        table.add_row(row["name"], *counts, number(row["mean"]), number(row["max"]))
    console.print(table)
    show_tools(result["stages"])
    if attempts := result.get("attempts"):
        console.print(_passes(attempts))
    cost = result.get("cost")
    console.print(
        f"model: {result['model']}; {result['calls']} calls, {result['tokens']} tokens, "
        f"cost {'unknown' if cost is None else format(cost, '.4g')}, "
        f"{result['rollouts']} rollouts, {result['seconds']:.1f} s"
    )
    if engine := result.get("engine"):  # older results lack it
        console.print(f"engine: {engine}")
    console.print(f"run: {result['run']}")
    for name, path in pictures.items():
        console.print(f"{name}: {path}")
    console.print(f"see every step in 3D: agentflow report {shlex.quote(result['run'])}")
    if ending := ending_of(result):
        console.print(ending)


def _show_seeds(runs: Sequence[Data]) -> None:
    """Print one line per run of several seeds, failed ones last; what follows is about the best."""
    table = columns("seed", "score", "verified", "found in stage", "calls", "seconds", "run")
    for run in (run for run in runs if not run["failed"]):
        scores = (number(run["score"]), number(run["verified"]), run["best_stage"] or "-")
        table.add_row(
            str(run["seed"]), *scores, str(run["calls"]), f"{run['seconds']:.1f}", run["run"]
        )
    output().print_wide(table)
    for run in runs:
        if run["failed"]:
            output().print(f"seed {run['seed']} failed: {run['failed']}")


def show_tools(stages: Sequence[Data]) -> None:
    """Print how often each tool was called by stage, if any was: "9 (2 refused)"."""
    counts = [stage.get("tools") or {} for stage in stages]
    names = dict.fromkeys(name for count in counts for name in count)
    table = columns("tool", *(stage["name"] for stage in stages))
    for name in names:
        table.add_row(name, *(_uses(count.get(name)) for count in counts))
    if names:
        output().print(table)


def _uses(count: Mapping[str, int] | None) -> str:
    if count is None:
        return "-"
    return f"{count['calls']}" + (f" ({count['refused']} refused)" if count["refused"] else "")


def record_text(record: Data) -> str:
    """A record: "70.21 (verified, pybullet 3.2.7) with 40 blocks, by hand"."""
    blocks = block_count(record["blocks"], None)
    made = f"{number(record['verified'])} (verified, {record['engine']})"
    return f"{made} with {blocks}, {record['how']}"


def record_line(record: Data) -> str:
    """The share of the greatest or best known score that a score reaches, in one line."""
    return f"{record['share']:.0%} of the {record['of']}; record: {record_text(record)}"


def verified_line(verified: Data) -> str:
    """The verified score and its spread, or which simulations are missing, in one line."""
    scores = verified["scores"]
    if verified["score"] is None:
        missing = (f"{s['variation']}: {s['status']}" for s in scores if s["score"] is None)
        return f"no verified score, because simulations failed ({', '.join(missing)})"
    return (
        f"verified score {number(verified['score'])}, the median of {len(scores)} simulations "
        f"that scored {number(verified['low'])} to {number(verified['high'])}"
    )


def show_objectives(result: Data) -> None:
    """Print the robust score and the Pareto front of a run that compared them."""
    console = output()
    if result.get("robust") is not None:
        robust = number(result["robust"])
        console.print(f"robust score {robust}, the 10 % quantile of 10 conditions")
    if front := result.get("front"):
        console.print(f"Pareto front: {len(front)} of the simulated machines")
        table = columns("machine", "robust", "score", "blocks", "mass, kg")
        for one in front[:FRONT]:
            scores = (number(one["robust"]), number(one["score"]))
            table.add_row(one["machine"], *scores, str(one["blocks"]), f"{one['mass']:g}")
        console.print(table)
        if len(front) > FRONT:
            console.print(f"and {len(front) - FRONT} more (--json)")


def _passes(attempts: Data) -> str:
    """Pass count of independent attempts with its 95 % interval."""
    count, total = attempts["passes"], attempts["attempts"]
    if not total:
        return "passes: no attempts were made"
    low, high = attempts["interval"]
    return (
        f"passes: {count} of {total} attempts ({attempts['share']:.0%}; 95 % interval {low:.0%} to "
        f"{high:.0%}); {attempts['parsed']} parsed, {attempts['spatial']} spatially valid"
    )


def ending_of(result: Data) -> str:
    """Why a run ended early, in one line; "" if it did not."""
    if result["stopped"] == "budget":
        after = "the result is the best so far" if result["valid"] else "no valid machine was found"
        return f"stopped early: budget limit reached; {after}"
    if result["stopped"] == "greatest score":
        return "a machine has the greatest possible score, which ended its search"
    if not result["valid"]:
        return " ".join(result["reason"].split())
    last = result["stages"][-1]
    if last["valid"] == 0:
        return f"ended early: no machine in stage {last['name']} was valid"
    if last["attempts"] and not last["children"]:
        return f"none of the {last['attempts']} refinements in stage {last['name']} was valid"
    return ""


def show_report(report: Data) -> None:
    """Print a validity report and its warnings."""
    console = output()
    for key, label in _CHECKED.items():
        words = {True: "yes", False: "no", None: "not checked"}[report[key]]
        console.print(f"{label}: {words}")
    if report["size"] is not None:
        console.print("size: " + " x ".join(f"{extent:g}" for extent in report["size"]) + " m")
    for problem in report["problems"]:
        console.print(f"{problem['code']}: {problem['message']}")
    for warning in report["warnings"]:
        console.print(f"warning: {warning['message']}")
    for block in report.get("blocks", ()):
        if "end_a" in block:
            console.print(f"block {block['id']}: from {block['end_a']} to {block['end_b']}")
        else:
            console.print(
                f"block {block['id']}: at {block['position']} facing {block['orientation']}"
            )


_CHECKED = {
    "file_valid": "file valid",
    "spatial_valid": "spatially valid",
    "machine_valid": "machine valid",
}


def show_edit(outcome: Data) -> None:
    """Print the verdict of each step, and the new machine if all succeeded."""
    console = output()
    for step in outcome["steps"]:
        console.print(f"{step['verdict']}: {step['text']}")
        if step["reason"]:
            console.print(f"  {step['code']}: {step['reason']}")
    console.print(outcome["outcome"])
    if outcome["outcome"] == "success":
        console.print(json.dumps(outcome["machine"]))


def show_conversion(result: Data) -> None:
    """Print what was written and which blocks were skipped; warnings."""
    console = output()
    for problem in result["left_out"]:
        console.print(f"skipped: {problem['message']}")
    for note in result["notes"]:
        console.print(f"note: {note}")
    for warning in result["warnings"]:
        console.print(f"warning: {warning}")
    console.print(f"{result['out']}: {result['blocks']} blocks")


def show_rollout(result: Data) -> None:
    """Print a rollout: status, score, feedback and query answers."""
    console = output()
    told = [result["status"], f"score {number(result['score'])}"]
    if result["blocks"] is not None:
        told.append(block_count(result["blocks"], result["most_blocks"]))
    if result["engine"] is not None:
        told.append(result["engine"])
    console.print(", ".join(told))
    for problem in result["problems"] or ():
        console.print(f"{problem['code']}: {problem['message']}")
    if result["feedback"]:
        console.print(result["feedback"])
    if result["marginal"]:
        console.print(marginal_line(result["marginal"]))
    for answer in result.get("answers", ()):
        console.print(str(answer))


def marginal_line(found: Sequence[Data]) -> str:
    """The connections nearest to their strength, in one line; `found` is not empty."""
    nearest = sorted(found, key=lambda item: abs(item["load"] - 1))
    told = [
        f"block {item['block']} off block {item['partner']} "
        f"{'nearly' if item['load'] < 1 else 'only just'} broke "
        f"({100 * item['load']:.0f} % of its strength, {item['time']:.2f} s)"
        for item in nearest[:MARGINAL]
    ]
    more = len(nearest) - MARGINAL
    return f"marginal: {'; '.join([*told, f'and {more} more'] if more > 0 else told)}"


def show_comparison(found: Data) -> None:
    """Print both machines, and the blocks that only one of them has."""
    console = output()
    table = columns("", "A", "B")
    for name, key in (("machine", "source"), ("blocks", "blocks"), ("mass, kg", "mass")):
        table.add_row(name, *(_plain(machine[key]) for machine in found["machines"]))
    table.add_row("size, m", *(_size(machine) for machine in found["machines"]))
    if found["task"]:
        status = (machine["status"] for machine in found["machines"])
        score = (number(machine["score"]) for machine in found["machines"])
        table.add_row(f"{found['task']}, seed {found['seed']}", *status)
        table.add_row("score", *score)
    if found["engine"]:
        console.print(f"engine: {found['engine']}")
    for note in found["notes"]:
        console.print(note)
    for kind in found["types"]:
        table.add_row(f"{kind['type']} {kind['name']}", *map(str, kind["counts"]))
    console.print_wide(table)
    for name, machine in zip("AB", found["machines"], strict=True):
        for problem in machine["problems"]:
            console.print(f"{name} is not valid for {found['task']}: {problem}")
    console.print(f"{found['same']} blocks are in both machines")
    for name, blocks in zip("AB", found["only"], strict=True):
        for block in blocks:
            ends = " to ".join(str(end) for end in block["positions"])
            where = f"{ends} facing {block['direction']}" if block["direction"] else ends
            console.print(f"only in {name}: block {block['id']} ({block['name']}) at {where}")
    for name, controls in zip("AB", found.get("controls", ()), strict=False):
        for control in controls:
            console.print(f"only in {name}: {control}")


def _plain(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def show_blocks(blocks: Sequence[Data]) -> None:
    """Print the block library as a table."""
    table = columns("type", "name", "category", "size", "mass", "faces", "set")
    for block in blocks:
        table.add_row(
            str(block["type"]),
            block["name"],
            block["category"],
            _size(block),
            f"{block['mass']:g}",
            str(len(block["faces"])),
            "extended" if block["extended"] else "core",
        )
    output().print(table)


def show_block(block: Data) -> None:
    """Print one block and its faces."""
    console = output()
    facts = (block["category"], _size(block), f"{block['mass']:g} kg")
    console.print(f"{block['type']} {block['name']}: {', '.join(facts)}")
    table = columns("face", "position", "direction")
    for face in block["faces"]:
        position = ", ".join(f"{value:g}" for value in face["position"])
        table.add_row(str(face["face_id"]), position, face["direction"])
    console.print(table)


def _size(block: Data) -> str:
    if block["size"] is None:
        return "two-ended"
    return " x ".join(f"{extent:g}" for extent in block["size"])


def show_tasks(tasks: Sequence[Data]) -> None:
    """Print the list of tasks, with a blank line between families."""
    table = columns("task", "level", "window", "good score", "record", "blocks", "objective")
    for index, task in enumerate(tasks):
        if index and task["family"] != tasks[index - 1]["family"]:
            table.add_row()
        table.add_row(
            task["name"],
            task["title"],
            f"{task['window']:g} s",
            _good_score(task),
            number(task["record"] and task["record"]["verified"]),
            str(len(task["blocks"])),
            task["objective"],
        )
    console = output()
    console.print(table)
    if engines := {task["record"]["engine"] for task in tasks if task["record"]}:
        console.print(f"records: {' and '.join(sorted(engines))}")


def _good_score(task: Data) -> str:
    """A good score, and the greatest possible one where there is one."""
    greatest = "" if task["greatest"] is None else f" of at most {task['greatest']:g}"
    return f"{task['good']:g}{greatest}"


def show_task(task: Data) -> None:
    """Print one level in full."""
    console = output()
    console.print(Text(f"{task['name']} ({task['title']}): {task['objective']}", style="bold"))
    for part in ("scene", "schedule", "score"):
        console.print(f"\n{part}")
        for sentence in task[part]:
            console.print(f"  {sentence}")
    console.print(f"\nblocks: {', '.join(task['block_names'])}")
    for kind, count in task["required"].items():
        console.print(f"required: exactly {count} of type {kind}")
    if task["most_blocks"] is not None:
        console.print(f"most blocks: {task['most_blocks']}")
    console.print(f"good score: {_good_score(task)}")
    if record := task["record"]:
        console.print(f"record: {record_text(record)}")
    if task["note"]:
        console.print(f"note: {task['note']}")
    console.print()
    table = columns("knob", "value", "range", "description")
    for knob in task["knobs"]:
        table.add_row(knob["name"], str(knob["value"]), knob["range"], knob["help"])
    console.print(table)


def show_diagnosis(found: Data) -> None:
    """Print what `agentflow doctor` found; the command prints the problem to stderr."""
    console = output()
    console.print(f"endpoint: {found['base_url']}")
    name = found["answered_as"]
    console.print(f"model: {found['model']}" + (f" (answers as {name})" if name else ""))
    for key in ("reachable", "authorised", "model_exists", "streaming", "usage", "reasoning"):
        words = {True: "yes", False: "no", None: "unknown"}[found[key]]
        console.print(f"{_DIAGNOSED.get(key, key)}: {words}")
    if found["machine"]:
        console.print(f"machine: {found['machine']}")
    for parameter, action in found["refused"].items():
        console.print(f"rejects {parameter}: {action}")
    if found["latency_s"] is not None:
        console.print(f"latency: {found['latency_s']:.2f} s")


_DIAGNOSED = {
    "model_exists": "model exists",
    "usage": "reports tokens",
    "reasoning": "returns reasoning",
}

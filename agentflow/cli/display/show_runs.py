"""Runs as text for people: results of new ones, records of finished ones; programs use --json."""

import shlex
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from itertools import pairwise

from agentflow.cli.display import show_scores
from agentflow.cli.display.output import Data, Field, columns, field, print_lines, table, tell
from agentflow.cli.display.show_machines import marginal_line
from agentflow.config.run import differing_text
from agentflow.metrics.tables import NOTHING, block_count, change, counted, money, number

STAGE = (
    field("stage", "name"),
    Field("valid 1st try", lambda stage: f"{stage['valid_first']}/{stage['trajectories']}"),
    Field("after retries", lambda stage: f"{stage['valid']}/{stage['trajectories']}"),
    field("mean", show=number),
    field("best", "max", number),
)
SEED = (
    field("seed"),
    field("score", show=number),
    Field("verified", lambda run: show_scores.verified_text(run["verified"], run["fragile"])),
    Field("found in stage", lambda run: run["best_stage"] or None),
    field("calls"),
    field("seconds", show=partial(number, digits=1)),
    field("run"),
)
ON_FRONT = (
    field("machine"),
    field("robust", show=number),
    field("score", show=number),
    field("blocks"),
    field("mass, kg", "mass", "{:g}".format),
)
MADE = (
    field("made by", "maker"),
    field("machines"),
    field("share", show="{:.0%}".format),
    field("better"),
    field("gain", show=number),
)
SPENT = (
    *map(field, ("role", "calls", "tokens", "reasoning")),
    field("seconds", show=partial(number, digits=1)),
    field("cost", "money", money),
)
MOST_OF_FRONT = 10
"""Most machines of a Pareto front that are printed; the data holds all."""


def show_result(result: Data, files: Mapping[str, str]) -> None:
    """Print the result of a design run: score, stages, model, cost, paths of its files by name."""
    if seeds := result.get("seeds"):
        _show_seeds(seeds)
    if result["valid"]:
        count = result.get("blocks") or len(result["machine"])  # older results lack the count
        blocks = block_count(count, result.get("most_blocks"))
        tell(
            f"best score {number(result['score'])} ({result['task']}), "
            f"{blocks}, found in stage {result['best_stage']}"
        )
    if verified := result.get("verified"):
        tell(show_scores.verified_line(verified))
    show_scores.show_requirements(result)
    if (record := result.get("record")) and record["share"] is not None:
        tell(show_scores.record_line(record))
    show_objectives(result)
    tell(table(STAGE, result["stages"]))
    if note := _lower_stage(result["stages"]):
        tell(note)
    show_tools(result["stages"])
    show_makers(result)
    if attempts := result.get("attempts"):
        tell(_passes(attempts))
    tell(
        f"model: {result['model']}; {counted(result['calls'], 'call')}, {result['tokens']} tokens, "
        f"cost {money(result.get('cost'), 'unknown')}, "
        f"{counted(result['rollouts'], 'rollout')}, {result['seconds']:.1f} s"
    )
    print_lines((field("engine"), field("run")), result)  # older results lack the engine
    for name, path in files.items():
        tell(f"{name}: {path}")
    tell(f"see every step in 3D: agentflow report {shlex.quote(result['run'])}")
    if ending := ending_of(result):
        tell(ending)


def _lower_stage(stages: Sequence[Data]) -> str:
    """Why the best of a later stage scores below that of an earlier one, for the first; else ""."""
    for before, stage in pairwise(stages):
        if None not in (before["max"], stage["max"]) and stage["max"] < before["max"]:
            blind = stage["name"] == "blind_refinement"
            why = " changes machines without having seen them simulated, and" * blind
            return (
                f"{stage['name']}{why} scored below {before['name']}: a stage's scores are those "
                "of the machines it made; the best machine of all stages is kept"
            )
    return ""


def _show_seeds(runs: Sequence[Data]) -> None:
    """Print one line per run of several seeds, failed ones last; what follows is about the best."""
    tell(table(SEED, (run for run in runs if not run["failed"])), wide=True)
    for run in runs:
        if run["failed"]:
            tell(f"seed {run['seed']} failed: {run['failed']}")


def show_objectives(result: Data) -> None:
    """Print how the best machine of a run was chosen, if not by its score alone."""
    if finalists := result.get("finalists"):
        first, simulations = finalists[0], sum(one["simulations"] for one in finalists)
        tell(
            f"chosen by the mean score of {len(finalists)} machines in {simulations} verifying "
            f"simulations; the machine with the highest score, {number(first['score'])}, has a "
            f"mean of {number(first['mean'])}"
        )
    if result.get("robust") is not None:
        robust = number(result["robust"])
        tell(f"robust score {robust}, the 10 % quantile of 10 conditions")
    if front := result.get("front"):
        tell(f"Pareto front: {len(front)} of the simulated machines")
        tell(table(ON_FRONT, front[:MOST_OF_FRONT]))
        if len(front) > MOST_OF_FRONT:
            tell(f"and {len(front) - MOST_OF_FRONT} more (--json)")


def show_makers(result: Data) -> None:
    """Print who made the machines of a search over the whole run, and what they gained."""
    if makers := result.get("makers"):
        tell(table(MADE, makers))


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


def show_tools(stages: Sequence[Data]) -> None:
    """Print how often each tool was called by stage, if any was: "9 (2 refused)"."""
    counts = [stage.get("tools") or {} for stage in stages]
    names = dict.fromkeys(name for count in counts for name in count)
    found = columns("tool", *(stage["name"] for stage in stages))
    for name in names:
        found.add_row(name, *(_uses(count.get(name)) for count in counts))
    if names:
        tell(found)


def _uses(count: Mapping[str, int] | None) -> str:
    if count is None:
        return NOTHING
    return f"{count['calls']}" + (f" ({count['refused']} refused)" if count["refused"] else "")


def show_runs(runs: Iterable[Data]) -> None:
    """Print a list of runs; columns name the engines, and what differs, if there are several."""
    runs = tuple(runs)
    sound = [item for item in runs if not item["problem"]]
    texts = differing_text([item["settings"] for item in sound])
    differs = {item["run"]: text for item, text in zip(sound, texts, strict=True) if text}
    engines = {item["engine"] for item in runs if item["engine"]}
    named = ("run", "state", "task", "workflow", "model", "seed", *["engine"] * (len(engines) > 1))
    fields = (
        *map(field, named),
        field("score", show=number),
        Field("verified", _verified),
        field("cost", show=money),
        *[Field("differs", lambda item: differs.get(item["run"]))] * bool(differs),
    )
    for item in runs:
        if item["problem"]:
            tell(item["problem"])
    if not runs:
        tell("no runs")
        return
    tell(table(fields, runs), wide=True)
    if len(engines) == 1:
        tell(f"engine: {engines.pop()}")


def _verified(item: Data) -> str:
    """The verified score of a listed run."""
    found = item["verified"] or {}
    return show_scores.verified_text(found.get("score"), found.get("fragile"))


def show_run(run: Data) -> None:
    """Print one run."""
    tell(f"{run['run']}: {run['state']}")
    made = (run["task"], run["workflow"], run["model"], f"seed {run['seed']}", run["engine"])
    tell(", ".join(filter(None, made)))
    if start := run["config"]["settings"].get("start"):
        blocks = start["blocks"] if isinstance(start, dict) else start
        tell(f"started from a machine with {len(blocks)} blocks")
    found = [f"best score {number(run['score'])}"]
    if run["blocks"] is not None:
        found.append(block_count(run["blocks"], run["most_blocks"]))
        found.append(f"found in stage {run['best_stage']}")
    tell(", ".join(found))
    if run["verified"]:
        tell(show_scores.verified_line(run["verified"]))
    show_objectives(run)
    if (record := run["record"]) and record["share"] is not None:
        tell(show_scores.record_line(record))
    if run["marginal"]:
        tell(marginal_line(run["marginal"]))
    if run["stopped"] or run["reason"]:
        limit = "limit " * (run["stopped"] == "budget")
        why = " ".join((run["reason"] or f"stopped: {run['stopped']} {limit}reached").split())
        tell(why)
    tell(table((*STAGE, field("calls"), field("rollouts")), run["stages"]))
    show_tools(run["stages"])
    show_makers(run)
    tell(table(SPENT, ({"role": role, **spent} for role, spent in run["spent"].items())))
    show_failures(run["failures"], every=False)
    for remark in run["remarks"]:
        tell(f"notice: {remark}")


def show_rescored(found: Data) -> None:
    """Print the machines whose rollouts differ from the record."""
    other = [item for item in found["machines"] if not item["identical"]]
    if other:
        engines = found["engine"]
        same = engines["recorded"] in (None, engines["now"])
        times = [name if same else f"{name} ({engines[name]})" for name in ("recorded", "now")]
        fields = (
            field("machine"),
            field("first simulated as", "place"),
            field(times[0], "recorded", show_scores.outcome),
            field(times[1], "now", show_scores.outcome),
            field("difference", show=partial(change, digits=3)),
        )
        tell(table(fields, other), wide=True)
    if found["note"]:
        tell(found["note"])
    for item in found["machines"]:
        if item["note"]:
            tell(f"notice: {item['machine']} {item['note']}")
    for name in ("constants", "engine"):
        condition = found[name]
        if condition["recorded"] != condition["now"]:
            recorded = condition["recorded"] or "unknown"
            tell(f"{name}: recorded {recorded}, now {condition['now']}")
    total = len(found["machines"])
    tell(f"{found['identical']} of {total} machines have the same rollout as recorded")


def show_failures(found: Data, *, every: bool = True) -> None:
    """Print the count of each kind of failure; with `every`, also of kinds that did not occur."""
    tell(
        f"{found['refused']} of {found['replies']} replies rejected; "
        f"{found['machines']} machines simulated"
    )
    totals = {"reply": f"{found['replies']} replies", "machine": f"{found['machines']} machines"}
    fields = (
        field("category", "level"),
        field("failure", "name"),
        field("count"),
        field("out of", "unit", totals.__getitem__),
    )
    if kinds := [kind for kind in found["kinds"] if every or kind["count"]]:
        tell(table(fields, kinds))

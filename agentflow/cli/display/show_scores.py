"""Scores as text for people: records, verified and robust scores, other engines."""

from collections.abc import Sequence

from agentflow.cli.display.output import Data, Field, columns, field, print_problems, table, tell
from agentflow.holding import Holding
from agentflow.metrics.tables import NOTHING, block_count, change, number

REQUIRED = (
    field("requirement"),
    field("value", show="{:.4g}".format),
    field("margin", show="{:.4g}".format),
    Field("met", lambda item: "yes" if item["met"] else "NO"),
    field("governed by", "cause"),
)
MOST_SENSITIVE = 5
"""Number of blocks and of faces shown, the most sensitive first."""


def outcome(item: Data) -> str:
    """A score, with the status of its simulation unless that is ok."""
    status = "" if item["status"] == "ok" else f" ({item['status']})"
    return f"{number(item['score'])}{status}"


def record_text(record: Data) -> str:
    """A record: "70.21 (verified, pybullet 3.2.7) with 40 blocks, by hand"."""
    blocks = block_count(record["blocks"], None)
    fragile = ", fragile" * record["fragile"]
    made = f"{number(record['verified'])} (verified{fragile}, {record['engine']})"
    return f"{made} with {blocks}, {record['how']}"


def record_line(record: Data) -> str:
    """The share of the greatest or best known score that a score reaches, in one line."""
    best = "a new best: " * (record["of"] == "record" and record["share"] > 1)
    full = "" if record["of"].startswith("record") else f"{number(record['full'])}; record: "
    return f"{best}{record['share']:.0%} of the {record['of']}, {full}{record_text(record)}"


def verified_line(verified: Data) -> str:
    """The verified score and its spread, or which simulations are missing, in one line."""
    scores = verified["scores"]
    if verified["score"] is None:
        missing = (f"{s['variation']}: {s['status']}" for s in scores if s["score"] is None)
        return f"no verified score, because simulations failed ({', '.join(missing)})"
    return (
        f"verified score {number(verified['score'])}, the median of {len(scores)} simulations "
        f"that scored {number(verified['low'])} to {number(verified['high'])}; "
        f"{_holding_text(verified)}"
    )


def _holding_text(verified: Data) -> str:
    """In how many simulations a score holds; of a fragile machine, where it fails."""
    held = Holding.of_verified(verified)
    if held is None:  # the file contradicts itself
        return "some of them have no score"
    count = f"holds in {held.holds} of {held.of}"
    if not held.fragile:
        return count
    fails = ", ".join(
        f"{item['variation']}: {number(item['score'])}"
        for item in verified["scores"]
        if item["variation"] in held.fails
    )
    return f"fragile, {count} ({fails})"


def verified_text(score: float | None, fragile: bool | None) -> str:
    """A verified score in a table, marked if its machine is fragile."""
    return number(score) + " (fragile)" * bool(fragile)


def show_verified(found: Data) -> None:
    """Print a verified score and the score under each variation."""
    if found["problems"]:
        tell(f"invalid, verified score {number(found['verified']['score'])}")
        print_problems(found["problems"])
        return
    tell(f"score {number(found['score'])} ({found['task']}, {found['engine']})")
    tell(verified_line(found["verified"]))
    fails = found["verified"]["fails"] or ()
    scores = [
        {**item, "holds": "no" if item["variation"] in fails else ""}
        for item in found["verified"]["scores"]
    ]
    _show_variations("simulation", scores, *[field("holds")] * bool(fails))
    for other in found["others"]:
        tell(f"not part of the median: {outcome(other)} with {other['engine']}")


def show_requirements(data: Data) -> None:
    """Print what a machine has of what is required; nothing without requirements."""
    judged = data.get("requirements") or ()
    if not judged:
        return
    tell(f"requirements: met {sum(item['met'] for item in judged)} of {len(judged)}")
    tell(table(REQUIRED, judged))


def show_robustness(found: Data) -> None:
    """Print how robust a design is."""
    if found["problems"]:
        tell("invalid; not simulated")
        print_problems(found["problems"])
        return
    tell(f"score {number(found['score'])} ({found['task']}, {found['engine']})")
    tell(f"robust score {number(found['robust'])}, the 10 % quantile of all conditions")
    others = [
        {**other, "variation": f"{other['engine']} (not in the quantile)"}
        for other in found["others"]
    ]
    _show_variations("condition", [*found["conditions"], *others])
    _show_edits(found)


def _show_variations(heading: str, scores: Sequence[Data], *more: Field) -> None:
    """Print the score under each variation, and its change against the first, the default one."""
    default = scores[0]

    def changed(item: Data) -> str:
        return "" if item is default else _relative(default["score"], item["score"])

    fields = (field(heading, "variation"), Field("score", outcome), Field("change", changed))
    tell(table((*fields, *more), scores))


def _relative(before: float | None, after: float | None) -> str:
    """The relative change of a score; "-" if it has none."""
    if not before or after is None:
        return NOTHING
    return f"{round(100 * (after / before - 1), 1) + 0.0:+.1f} %"  # no negative zero


def _show_edits(found: Data) -> None:
    spread = found["edits"]
    lost = f"; {spread['missing']} failed for technical reasons" if spread["missing"] else ""
    tell(f"{spread['count']} neighbours, one edit away{lost}")
    if not spread["count"]:
        return
    if spread["kept"] is not None:
        tell(f"{spread['kept']:.0%} keep at least half of the score")
    quantiles = (f"{share}: {number(at)}" for share, at in spread["quantiles"].items())
    tell(f"quantiles of their scores: {', '.join(quantiles)}")
    fields = (Field("most sensitive", _place), field("mean score of its edits", "mean", number))
    sensitive = (*found["blocks"][:MOST_SENSITIVE], *found["faces"][:MOST_SENSITIVE])
    tell(table(fields, sensitive))


def _place(item: Data) -> str:
    face = f"face {item['face']} of " if "face" in item else ""
    return f"{face}block {item['block']} ({item['name']})"


def show_engines(found: Data) -> None:
    """Print the results of each machine, and the rank correlations of each family."""
    engines = found["engines"]
    first, *others = engines
    breaks = (f"first break ({engine})" for engine in engines)
    machines = columns("machine", *engines, *["difference"] * len(others), *breaks)
    for item in found["machines"]:
        results = item["results"]
        known = all(result["status"] == "ok" for result in results)
        more = (change(r["score"] - results[0]["score"] if known else None) for r in results[1:])
        machines.add_row(
            item["machine"], *map(outcome, results), *more, *map(_first_break, results)
        )
    tell(machines, wide=True)
    families = columns("family", "machines", *(f"{engine}, Spearman" for engine in others))
    for family in found["families"]:
        ranks = (number(correlation, 3) for correlation in family["correlations"])
        families.add_row(family["family"], str(family["machines"]), *ranks)
    tell(families)
    tell(f"correlations are with {first}")
    if found["note"]:
        tell(found["note"])


def _first_break(result: Data) -> str:
    broken = result["first_break"]
    return "none" if broken is None else f"block {broken['block']}, {broken['time']:.2f} s"

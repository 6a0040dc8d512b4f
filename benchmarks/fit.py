"""Fits physical constants to the published throw by grid search over some of them.

    python benchmarks/fit.py motor_torque.22=1800:3000:400 motor_speed.22=7:10:1
    python benchmarks/fit.py spring_force=200:1200:200

Prints the misfits of the ten best points, averaged over the machine with ballast and the one with
ballast and springs. It does not change constants.json.
"""

from __future__ import annotations

import argparse
import itertools
from statistics import fmean

import numpy as np
from published import Misfit, machines, misfit, throw

from agentflow.env.constants import Constants, constants
from agentflow.env.physics.engines import choose_engine

FITTED = ("with ballast", "with ballast and springs")
SHOWN = 10
COLUMNS = {
    "boulder": "boulder rms m",
    "rotor": "rotor rms m",
    "turn": "turn rms rad",
    "after": "after break m",
    "top_place": "block 8 first m",
    "top_speed": "the same m/s",
    "first_break": "break - 0.4 s",
}
"""Columns: with ballast / with ballast and springs."""


def main() -> None:
    """Search the grid."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("axes", nargs="+", help="name=low:high:step, or name.type=...")
    names, values = zip(*(_axis(text) for text in parser.parse_args().axes), strict=True)
    rows = [(_misfits(constants()), "as shipped")]
    for point in itertools.product(*values):
        chosen = dict(zip(names, point, strict=True))
        label = " ".join(f"{name}={value:g}" for name, value in chosen.items())
        rows.append((_misfits(constants().changed(chosen)), label))
    print("  cost  " + "".join(f"{title:16s}" for title in COLUMNS.values()).rstrip())
    for found, label in [rows[0], *sorted(rows[1:], key=_cost)[:SHOWN]]:
        print(_row(found, label))


def _axis(text: str) -> tuple[str, list[float]]:
    name, _, span = text.partition("=")
    low, high, step = (float(part) for part in span.split(":"))
    return name, np.arange(low, high + step / 2, step).tolist()


def _misfits(physics: Constants) -> list[Misfit]:
    found, engine = machines(), choose_engine().start(physics)
    rollouts = [throw(found[name], 1.0, engine, physics) for name in FITTED]
    engine.close()
    return [misfit(rollout) for rollout in rollouts]


def _cost(row: tuple[list[Misfit], str]) -> float:
    return fmean(each.cost for each in row[0])


def _row(found: list[Misfit], label: str) -> str:
    columns = (" / ".join(f"{getattr(each, name):5.2f}" for each in found) for name in COLUMNS)
    return f"{_cost((found, label)):6.2f}  " + "   ".join(columns) + f"   {label}"


if __name__ == "__main__":
    main()

"""Controllers for tests."""

from __future__ import annotations

import copy
import json
from typing import Any

from agentflow.machine import Machine
from agentflow.machine.formats.parse import Reading, read_machine
from tests.machine.builders import CAR

STOPPING: dict[str, Any] = {
    "sensors": {
        "ahead": {"kind": "distance", "axis": "z+"},
        "speed": {"kind": "velocity", "axis": "z"},
        "wheel": {"kind": "turning", "block": 3},
    },
    "laws": {
        "gap": {"kind": "pd", "sensor": "ahead", "target": 2, "p": -0.3},
        "brake": {"kind": "pd", "sensor": "speed", "p": 0.1, "limits": [-2, 2]},
        "slow": {"kind": "sum", "terms": [{"law": "gap"}, {"law": "brake", "weight": 0.5}]},
        "full": {"kind": "schedule", "points": [[0, 1], [4.5, 0.5]], "rate": 2},
        "drive": {
            "kind": "states",
            "states": [
                {
                    "name": "go",
                    "law": "full",
                    "leave": [{"sensor": "ahead", "below": 9, "to": "s"}],
                },
                {"name": "s", "law": "slow"},
            ],
        },
        "latch": {"kind": "switch", "sensor": "wheel", "over": 90, "under": 10},
    },
    "outputs": [{"blocks": [3, 4], "law": "drive"}, {"blocks": [5], "law": "latch", "scale": -1}],
}
"""Of a car that stops before a wall; its wheels are blocks 3 to 6."""


def with_change(path: str, value: object, data: dict[str, Any] = STOPPING) -> dict[str, Any]:
    """The data with another value at a dotted path; `...` removes it."""
    changed = copy.deepcopy(data)
    node: Any = changed
    *parents, last = path.split(".")
    for key in parents:
        node = node[int(key) if isinstance(node, list) else key]
    if value is ...:
        del node[last]
    else:
        node[int(last) if isinstance(node, list) else last] = value
    return changed


def read_car(data: object) -> Reading:
    """The reading of the car with these controllers."""
    return read_machine({"blocks": CAR.to_json(), "controllers": data})


def sensing_car(data: object = STOPPING) -> Machine:
    """The car with these controllers, which must be right."""
    machine = read_car(data).machine
    assert machine is not None, json.dumps(data)
    return machine

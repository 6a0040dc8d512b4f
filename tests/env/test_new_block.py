"""A block type that recombines known behaviours is added by data alone."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

import agentflow
from tests.processes import run_python

AXLE = 23
ENTRY: dict[str, Any] = {
    "type": AXLE,
    "name": "Long Motor Axle",
    "category": "Powered joint",
    "set": "extended",
    "size_xyz": [1, 1, 3],
    "mass": 1.5,
    "linear_drag": 0.2,
    "angular_drag": 0,
    "flags": ["non_static", "non_stable"],
    "shape": "cylinder",
    "joint": {"kind": "revolute"},
    "motor_name": "motor axles",
    "bsg": [["Single", "bmt-speed", "2"]],
    "faces": [{"id": 0, "position": [0, 0, 3], "direction": "Front"}],
}
FITTED = {"motor_speed": 5.0, "motor_torque": 3000.0, "strength_force": 20000.0}
"""What constants.json says of the type."""

PROGRAM = """
import json
from dataclasses import replace
from agentflow.env.physics.assembly import assemble
from agentflow.env.constants import constants
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.families.movement import Movement
from agentflow.env.tasks.family import schedule_sentences
from agentflow.env.tasks.registry import get_task
from agentflow.machine import ROOT, Machine, Step, check, describe_text, library, place
from agentflow.machine.formats.bsg_writing import to_bsg
from agentflow.machine.formats.bsg_reading import read_bsg

class Open(Movement):
    @property
    def brief(self):
        return replace(super().brief, blocks=tuple(library()))

task = Open(**vars(get_task("movement")))
column = [Step(1, 35, 0, 5), Step(2, 35, 1, 0)]
machine = Machine((ROOT, *column, Step(3, 23, 0, 4), Step(4, 1, 3, 0)))
joint = assemble(machine, place(machine), constants()).joints[2]
rollout = simulate(machine, task, interval=0.5)
spin = rollout.trace.angular_velocity[-1]
print(json.dumps({
    "problems": [problem.code for problem in check(machine).problems],
    "valid": check(machine, task.brief).task_valid,
    "text": describe_text(machine),
    "schedule": schedule_sentences(task.schedule, 5.0, (0, 2, 22, 23)),
    "reread": read_bsg(to_bsg(machine), tuple(library())).machine == machine,
    "bsg": 'key="bmt-speed">2<' in to_bsg(machine),
    "joint": [joint.kind, joint.drive.speed, joint.drive.torque, joint.strength.force],
    "status": rollout.status,
    "broken": len(rollout.broken),
    "spin": (spin[3] - spin[0]).tolist(),
    "driven": spin[4, 1],
}))
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the program says, run on a copy of the package whose data files know the block."""
    root = tmp_path_factory.mktemp("copy")
    package = shutil.copytree(Path(agentflow.__file__).parent, root / "agentflow")
    blocks, fitted = package / "machine/blocks/blocks.json", package / "env/constants.json"
    document = json.loads(blocks.read_text())
    blocks.write_text(json.dumps({**document, "blocks": [*document["blocks"], ENTRY]}))
    constants = json.loads(fitted.read_text())
    for name, value in FITTED.items():
        constants[name].setdefault("by_type", {})[str(AXLE)] = value
    fitted.write_text(json.dumps(constants))
    done = run_python("-c", PROGRAM, cwd=root, PYTHONPATH=str(root))
    return dict(json.loads(done.stdout.splitlines()[-1]))


@pytest.mark.slow
def test_it_is_legal_where_a_task_lists_it(report: dict[str, Any]) -> None:
    assert report["problems"] == ["type_not_allowed"]
    assert report["valid"]


@pytest.mark.slow
def test_it_is_described_and_told_of_in_the_schedule(report: dict[str, Any]) -> None:
    assert "Long Motor Axle" in report["text"]
    assert (
        "At t = 0 s wheels, motor axles and rotating blocks start to turn and never stop."
        in (report["schedule"])
    )


def test_it_is_written_to_besiege_files_and_read_again(report: dict[str, Any]) -> None:
    assert report["reread"]
    assert report["bsg"]


def test_its_motor_turns_what_it_carries(report: dict[str, Any]) -> None:
    assert report["joint"] == ["revolute", 5.0, 3000.0, 20000.0]
    assert (report["status"], report["broken"]) == ("ok", 0)
    assert report["spin"] == pytest.approx([0.0, 5.0, 0.0], abs=0.2)
    assert abs(report["driven"]) > 1.0

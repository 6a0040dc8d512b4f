"""A session made by hand, whose episodes and measures are worked out in the tests."""

from __future__ import annotations

from pathlib import Path

from agentflow.machine import Machine
from agentflow.study.session import (
    Action,
    Note,
    Operation,
    Pause,
    Session,
    SessionLog,
    SessionStart,
    StudioTest,
    read_session,
)
from tests.machine.builders import build

CHASSIS = ((1, 0, 0), (1, 0, 1))
LEFT, RIGHT = ((2, 1, 1), (2, 1, 3)), ((2, 2, 1), (2, 2, 3))
TWO_WHEELS, FOUR_WHEELS = build(*CHASSIS, *LEFT), build(*CHASSIS, *LEFT, *RIGHT)
HINGED = build(*CHASSIS, (5, 1, 1))

TRANSCRIPT = """WEBVTT

NOTE Invented for this test: nobody said this.

00:24.000 --> 00:26.000
It turns because only <i>one side</i> drives.

00:00:41.500 --> 00:00:44.000
<v Person>The hinge should hold the car straight.
"""


class Clock:
    """Seconds that a test sets."""

    def __init__(self) -> None:
        self.at = 1000.0

    def __call__(self) -> float:
        return self.at


def record(folder: Path, note: str = "It will go farther with four wheels.") -> Session:
    """The session, as `SessionLog` writes it; pauses come from the gaps."""
    clock = Clock()
    log = SessionLog.begin(folder, SessionStart(task="movement", machine=build().to_json()), clock)

    def act(at: float, do: Operation, machine: Machine) -> None:
        log.append(Action(at=at, do=do, machine=machine.to_json()))

    def test(at: float, seconds: float, machine: Machine, score: float) -> None:
        found = StudioTest(
            at=at, seconds=seconds, machine=machine.to_json(), score=score, status="ok"
        )
        log.append(found)

    act(10, "add", build(CHASSIS[0]))  # 0-10 pause, 10-17 building
    act(12, "add", build(*CHASSIS))
    act(14, "add", build(*CHASSIS, LEFT[0]))
    act(16, "add", TWO_WHEELS)
    test(17, 3, TWO_WHEELS, 4.0)  # 17-22 testing
    act(22, "watch", TWO_WHEELS)  # 22-23 looking, 23-33 pause
    act(33, "add", build(*CHASSIS, *LEFT, RIGHT[0]))  # 33-38 building
    act(35, "add", FOUR_WHEELS)
    log.append(Note(at=36, text=note))
    test(38, 2, FOUR_WHEELS, 3.0)  # 38-40 testing, 40-47 pause
    act(47, "new", build())  # 47-50 building
    act(48, "add", build(*CHASSIS))
    act(49, "add", HINGED)
    test(50, 1, HINGED, 3.5)  # 50-51 testing
    log.append(Pause(at=51, seconds=3, asked=True))  # 51-54 break, 54-60 pause
    clock.at += 60
    log.finish("finished")
    return read_session(folder)

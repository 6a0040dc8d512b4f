"""Hand-made worlds and traces, for tests of what only looks at them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from agentflow.env.physics.engine import EngineIdentity, World
from agentflow.env.physics.engines import default_engine
from agentflow.env.physics.model import Assembly
from agentflow.env.rollout import Broken, Feedback, Rollout, Trace
from agentflow.env.scene import Body, Scene
from agentflow.machine.geometry.vectors import IDENTITY, Quat, Vec3
from agentflow.machine.tree import ROOT, Machine, Step

BOULDER = 2
THROWER = Machine((ROOT, Step(1, 30, 0, 4), Step(BOULDER, 36, 1, 0)))
"""A container on top of the root, with the boulder in it."""
LONE_ROOT = Machine((ROOT,))


@dataclass
class FakeWorld:
    """A world that stands where the test puts it."""

    time: float = 0.0
    centres: dict[Body, Vec3] = field(default_factory=dict)
    contacts: dict[Body, frozenset[Body]] = field(default_factory=dict)
    levels: dict[str, float] = field(default_factory=dict)
    rotations: dict[Body, Quat] = field(default_factory=dict)

    def centre(self, body: Body) -> Vec3:
        return self.centres.get(body, (0.0, 0.5, 0.0))

    def origin(self, block: int) -> Vec3:
        return self.centre(block)

    def rotation(self, body: Body) -> Quat:
        return self.rotations.get(body, IDENTITY)

    def touching(self, body: Body) -> frozenset[Body]:
        return self.contacts.get(body, frozenset())


class AlteredWorld:
    """A world that does all that another does; subclasses alter some of it."""

    def __init__(self, world: World) -> None:
        self.world = world

    def __getattr__(self, name: str) -> Any:
        return getattr(self.world, name)


class AlteredEngine:
    """The default engine, but each of its worlds is altered."""

    def __init__(self, alter: Callable[[World], Any]) -> None:
        self._engine, self._alter = default_engine().start(), alter

    @property
    def identity(self) -> EngineIdentity:
        return self._engine.identity

    def build(self, assembly: Assembly, scene: Scene, rate: float) -> World:
        world: World = self._alter(self._engine.build(assembly, scene, rate))
        return world

    def close(self) -> None:
        self._engine.close()


def make_trace(
    blocks: int,
    samples: int = 26,
    interval: float = 0.2,
    paths: Mapping[int, Sequence[Vec3]] | None = None,
    **changes: object,
) -> Trace:
    """A trace in which everything rests, but for the blocks whose paths are given."""
    position = np.zeros((samples, blocks, 3))
    for block, path in (paths or {}).items():
        position[:, block] = path
    objects = len(changes.get("objects", ()))  # type: ignore[arg-type]
    arrays: dict[str, object] = {
        "times": np.arange(samples) * interval,
        "position": position,
        "centre": position.copy(),
        "rotation": np.tile(IDENTITY, (samples, blocks, 1)),
        "velocity": np.zeros((samples, blocks, 3)),
        "angular_velocity": np.zeros((samples, blocks, 3)),
        "alive": np.ones((samples, blocks), dtype=bool),
        "length": np.zeros((samples, 0)),
        "linear": (),
        "pull": np.zeros((samples, 0)),
        "work": np.zeros((samples, 0)),
        "utilisation": np.zeros((samples, 0)),
        "connections": (),
        "object_position": np.zeros((samples, objects, 3)),
        "object_rotation": np.tile(IDENTITY, (samples, objects, 1)),
        "object_velocity": np.zeros((samples, objects, 3)),
        "objects": (),
        "regular": np.ones(samples, dtype=bool),
    }
    return Trace(**{**arrays, **changes})  # type: ignore[arg-type]


def make_rollout(trace: Trace | None, broken: tuple[Broken, ...] = ()) -> Rollout:
    """An `ok` rollout around a trace; `invalid` without one."""
    return Rollout(
        status="ok" if trace else "invalid",
        score=0.0,
        terms={},
        problems=(),
        broken=broken,
        events=(),
        feedback=Feedback("", {}),
        trace=trace,
        digest=None,
        sim_seconds=None,
        wall_seconds=None,
        constants=None,
    )

"""The registry of physics engines, and how one is chosen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

from agentflow.env.physics.engine import Engine, EngineIdentity
from agentflow.errors import ConfigError, UnknownNameError
from agentflow.machine.brief import Limits
from agentflow.registry import Registry, instance_of

if TYPE_CHECKING:
    from agentflow.env.constants import Constants


@dataclass(frozen=True)
class EngineSpec:
    """How to start an engine; its library is loaded only when it starts."""

    name: str
    libraries: tuple[str, ...]
    """Distributions that provide its library; the first installed one is used."""
    factory: str
    """"module:attribute" of a callable that makes the engine from its constants (or None: those of
    `constants.json`)."""
    most_parts: int | None = None
    """Most parts that it can hold in one piece of a machine; None: any number."""

    @cached_property
    def identity(self) -> EngineIdentity:
        """Name and library version, determined without loading the library.

        Raises:
            ConfigError: The library is not installed.
        """
        for library in self.libraries:
            try:
                return EngineIdentity(self.name, version(library))
            except PackageNotFoundError:
                continue
        needed = " or ".join(self.libraries)
        raise ConfigError(f"the physics engine {self.name!r} needs {needed}; install it")

    def start(self, physics: Constants | None = None) -> Engine:
        """Load the library and make an engine."""
        module, _, attribute = self.factory.partition(":")
        engine: Engine = getattr(import_module(module), attribute)(physics)
        return engine


ENGINES: Registry[EngineSpec] = Registry(
    "physics engine",
    "agentflow.engines",
    {
        "pybullet": "agentflow.env.physics.pybullet:PYBULLET",
        "mujoco": "agentflow.env.physics.mujoco:MUJOCO",
    },
    instance_of(EngineSpec),
)
"""All engines, the preferred one first."""


AUTO = "auto"
"""Name that stands for the default engine."""


def installed_engines() -> tuple[EngineSpec, ...]:
    """The engines whose library is installed, the preferred one first."""
    return tuple(spec for spec in ENGINES.values() if _is_installed(spec))


def default_engine() -> EngineSpec:
    """The first registered engine whose library is installed.

    Rollouts record `str()` of its `identity`, e.g. "pybullet 3.2.7".

    Raises:
        ConfigError: None is installed.
    """
    for spec in ENGINES.values():
        if _is_installed(spec):
            return spec
    needed = ", ".join(spec.libraries[0] for spec in ENGINES.values())
    raise ConfigError(f"no physics engine is installed; install one of: {needed}")


def choose_engine(name: str = AUTO) -> EngineSpec:
    """The engine of this name; `AUTO` is the default one.

    Raises:
        UnknownNameError: There is no such engine.
        ConfigError: Its library is not installed.
    """
    if name == AUTO:
        return default_engine()
    if name not in ENGINES:
        raise UnknownNameError("physics engine", name, (AUTO, *ENGINES))
    spec = ENGINES[name]
    try:
        _ = spec.identity
    except ConfigError as error:
        others = ", ".join(each.name for each in installed_engines())
        instead = f", or use one that is installed: {others}" if others else ""
        raise ConfigError(f"{error}{instead}") from None
    return spec


def usable_engine(name: str) -> str:
    """The name of an engine if it can be used here, else `AUTO`."""
    return name if name in ENGINES and _is_installed(ENGINES[name]) else AUTO


def engine_limits(name: str = AUTO) -> Limits:
    """Limits of every machine: the standard building volume, and what the engine holds.

    The engine need not be installed here: runs of others can be read without it.
    """
    if name != AUTO and name not in ENGINES:
        return Limits()
    spec = default_engine() if name == AUTO else ENGINES[name]
    return Limits(parts=spec.most_parts, engine=spec.name)


def _is_installed(spec: EngineSpec) -> bool:
    try:
        return bool(spec.identity)
    except ConfigError:
        return False

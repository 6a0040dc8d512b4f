"""Physics engines: how one is chosen."""

from agentflow.env.constants import constants
from agentflow.env.physics.engine import AUTO, EngineSpec
from agentflow.env.physics.registry import ENGINES
from agentflow.errors import ConfigError, UnknownNameError
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Limits


def installed_engines() -> tuple[EngineSpec, ...]:
    """The engines whose library is installed, the preferred one first."""
    return tuple(spec for spec in ENGINES.values() if _is_installed(spec))


def default_engine() -> EngineSpec:
    """The first registered engine whose library is installed.

    Rollouts record `str()` of its `identity`, e.g. "pybullet 3.2.7".

    Raises:
        ConfigError: None is installed.
    """
    for spec in ENGINES.values():  # the first is found without loading the others
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


def physics_conditions(name: str = AUTO) -> dict[str, str]:
    """What decides the result of a simulation besides machine and task: constants, blocks, engine.

    Raises:
        ConfigError: The engine of this name is not installed.
    """
    return {
        "constants": constants().digest,
        "blocks": library().digest,
        "engine": str(choose_engine(name).identity),
    }


def _is_installed(spec: EngineSpec) -> bool:
    try:
        return bool(spec.identity)
    except ConfigError:
        return False

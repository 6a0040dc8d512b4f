"""Libraries that only some uses need: whether they are installed, and how to install them."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from agentflow.errors import ConfigError

DISTRIBUTION = "agentflow-machines"
"""What `pip install` calls this package."""


def install(extra: str) -> str:
    """The command that installs an extra of this package."""
    return f"pip install '{DISTRIBUTION}[{extra}]'"


def missing(library: str, extra: str = "") -> ConfigError:
    """The error without a library, which an extra brings, or nothing but its own name ("")."""
    how = install(extra) if extra else f"pip install {library}"
    return ConfigError(f"{library} is not installed; install it with: {how}")


def is_installed(library: str) -> bool:
    """Whether a library can be imported; does not import it."""
    return find_spec(library) is not None


@contextmanager
def needs_extra(extra: str, *apart: str) -> Iterator[None]:
    """Imports of what an extra brings, except libraries that are installed `apart` from it.

    Raises:
        ConfigError: One of them is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        library = str(error.name).partition(".")[0]
        raise missing(library, "" if library in apart else extra) from None

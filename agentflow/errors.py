"""The exceptions of agentflow. Imports nothing; everything else may import it.

    AgentflowError
    ├── UsageError              what the user asked for cannot be done        exit 2
    │   ├── UnknownNameError    no task, workflow, block ... of that name
    │   ├── ConfigError         a configuration key is wrong
    │   ├── RunError            a run directory is busy, damaged, unwritable
    │   └── PromptError         a template of a prompt set is wrong or lacks a variable
    ├── EndpointError           the model endpoint cannot be used             exit 4
    │   ├── UnreachableError    nothing answers at the base URL
    │   ├── UnauthorisedError   401 or 403
    │   ├── ModelNotFoundError  404
    │   └── RefusedError        any other final answer that is no reply
    ├── ReplayMissError         a request that the record does not hold       exit 1
    ├── InterruptedRunError     Ctrl-C; what is recorded can be resumed       exit 130
    └── BudgetSpentError        calls, tokens or money have run out; ends a workflow cleanly

An unparsable reply, an invalid machine and a diverged simulation are none of these: they are
recorded results. A bug raises whatever Python raises.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class AgentflowError(Exception):
    """Base of all errors that a user can do something about; shown without a traceback."""

    exit_status = 2


class UsageError(AgentflowError):
    """What was asked for cannot be done; the message names what to change."""


class UnknownNameError(UsageError):
    """A name nobody knows. Lists the nearest known names first."""

    def __init__(self, kind: str, name: object, known: Iterable[object]) -> None:
        names = [str(item) for item in known]
        near = get_close_matches(str(name), names, n=3, cutoff=0.5)
        listed = near + [item for item in names if item not in near]
        shown = ", ".join(listed[:8]) + (", ..." if len(listed) > 8 else "")
        said = str(name) if len(str(name)) <= 60 else f"{str(name)[:60]}..."
        super().__init__(f"unknown {kind} {said!r}; known: {shown}")
        self.kind, self.name, self.nearest = kind, name, near


class ConfigError(UsageError):
    """A configuration key is missing, unknown or out of range; the message names the key."""


class RunError(UsageError):
    """A run directory cannot be used: busy, damaged, unwritable or of a foreign schema."""


class PromptError(UsageError):
    """A template cannot be rendered; the message names prompt set, template and variable."""


class EndpointError(AgentflowError):
    """The model endpoint cannot be used."""

    exit_status = 4


class UnreachableError(EndpointError):
    """Nothing answers at the base URL, also after the retries."""


class UnauthorisedError(EndpointError):
    """The endpoint refuses the key, or there is none."""


class ModelNotFoundError(EndpointError):
    """The endpoint does not know the model."""


class RefusedError(EndpointError):
    """The endpoint answered, and what it answered is final and no reply."""


class ReplayMissError(AgentflowError):
    """A request that was not recorded; the message names what differs."""

    exit_status = 1


class BudgetSpentError(AgentflowError):
    """The budget of calls, tokens or money has run out; workflows stop cleanly on it."""

    exit_status = 0


class InterruptedRunError(AgentflowError):
    """The user stopped a run; the message says how to continue it."""

    exit_status = 130


def yaml_problem(error: Exception) -> str:
    """What is wrong with a YAML text, in one line and with the number of its line if known."""
    mark = getattr(error, "problem_mark", None)
    why = getattr(error, "problem", None) or str(error).partition("\n")[0]
    return f"line {mark.line + 1}: {why}" if mark else why

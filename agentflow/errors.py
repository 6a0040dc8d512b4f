"""All exceptions of agentflow.

    AgentflowError
    ├── UsageError              the request cannot be carried out             exit 2
    │   ├── UnknownNameError    no task, workflow, block ... has that name
    │   ├── ConfigError         a configuration key is invalid
    │   ├── RunError            a run directory is busy or unwritable
    │   │   └── DamagedError    a record is not as it was written
    │   ├── PromptError         a prompt template is invalid or lacks a variable
    │   └── PluginError         a part of another distribution failed
    ├── EndpointError           the model endpoint cannot be used             exit 4
    │   ├── UnreachableError    no answer from the base URL
    │   │   └── SilentError     connected, but nothing comes in time
    │   ├── UnauthorisedError   401 or 403
    │   ├── ModelNotFoundError  404
    │   └── RefusedError        any other permanent failure
    ├── NoScoreError            a simulation timed out or crashed           exit 1
    ├── ReplayMissError         a request that was not recorded               exit 1
    ├── InterruptedRunError     Ctrl-C; the run can be resumed                exit 130
    └── BudgetSpentError        call, token or cost limit reached; ends a workflow cleanly

An unparsable reply, an invalid machine and a diverged simulation are not errors but recorded
results. Bugs raise ordinary Python exceptions.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class AgentflowError(Exception):
    """Base of all errors that a user can act on; shown without a traceback."""

    exit_status: int = 2
    """Exit status of the command line."""


class UsageError(AgentflowError):
    """The request cannot be carried out; the message says what to change."""


class UnknownNameError(UsageError):
    """An unknown name. The message lists the closest known names first."""

    def __init__(self, kind: str, name: object, known: Iterable[object]) -> None:
        names = [str(item) for item in known]
        near = get_close_matches(str(name), names, n=3, cutoff=0.5)
        listed = near + [item for item in names if item not in near]
        choices = ", ".join(listed[:8]) + (", ..." if len(listed) > 8 else "")
        short = str(name) if len(str(name)) <= 60 else f"{str(name)[:60]}..."
        super().__init__(f"unknown {kind} {short!r}; known: {choices}")
        self.kind, self.name, self.nearest = kind, name, near
        self._known = names

    def __reduce__(self) -> tuple[type[UnknownNameError], tuple[str, object, list[str]]]:
        """Worker processes send errors to their parent."""
        return type(self), (self.kind, self.name, self._known)


class ConfigError(UsageError):
    """A configuration key is missing, unknown or out of range; the message names the key."""


class RunError(UsageError):
    """A run directory is busy, damaged, unwritable or has an unsupported schema."""


class DamagedError(RunError):
    """A part of a record is not as it was written; trying again does not help."""


class PluginError(UsageError):
    """A part of another distribution failed; the message names it and its package."""


class PromptError(UsageError):
    """A template cannot be rendered; the message names prompt set, template and variable."""


class EndpointError(AgentflowError):
    """The model endpoint cannot be used."""

    exit_status = 4


class UnreachableError(EndpointError):
    """No answer from the base URL, even after retries."""


class SilentError(UnreachableError):
    """The endpoint took the request, but sent nothing for too long, even after retries."""


class UnauthorisedError(EndpointError):
    """The endpoint rejected the API key, or none was given."""


class ModelNotFoundError(EndpointError):
    """The endpoint does not know the model."""


class RefusedError(EndpointError):
    """The endpoint answered with a permanent error or something other than a reply."""


class NoScoreError(AgentflowError):
    """A simulation timed out or crashed, where there is no other way to say so than an error."""

    exit_status = 1


class ReplayMissError(AgentflowError):
    """A request that was not recorded; the message names what differs."""

    exit_status = 1


class BudgetSpentError(AgentflowError):
    """The call, token or cost limit is reached; workflows stop cleanly."""

    exit_status = 0


class InterruptedRunError(AgentflowError):
    """The user stopped a run; the message says how to resume it."""

    exit_status = 130

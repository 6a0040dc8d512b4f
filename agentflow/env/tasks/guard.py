"""Checks what task families of other distributions do; their faults name family and method.

Faults of our own families are bugs, which propagate as ordinary exceptions.
"""

from collections.abc import Callable
from concurrent.futures import Future, wait
from functools import partial, wraps
from math import isfinite
from threading import Thread
from types import SimpleNamespace
from typing import Any

from agentflow.env.rollout import Feedback, Verdict
from agentflow.env.scene import Scene
from agentflow.errors import AgentflowError, PluginError
from agentflow.machine.brief import Brief

OURS = "agentflow."
PATIENCE = 30.0
"""Seconds that a method of a family may take. Those of its referee have the time of the rollout."""


def is_ours(family: type) -> bool:
    """Whether a class is of this distribution."""
    return family.__module__.startswith(OURS)


def guard_family(family: type) -> None:
    """Make the methods that a class defines raise PluginError for exceptions and wrong results, and
    where they do not end."""
    if is_ours(family):
        return
    for name, (expected, fits) in _RESULTS.items():
        method = vars(family).get(name)
        if isinstance(method, property) and method.fget is not None:
            timed = _timed(method.fget)
            setattr(family, name, property(_guarded(timed, family, name, expected, fits)))
        elif callable(method):
            setattr(family, name, _guarded(_timed(method), family, name, expected, fits))
    if callable(referee := vars(family).get("referee")):
        family.referee = _with_guarded_referee(referee, family)  # type: ignore[attr-defined]


def _guarded(
    method: Callable[..., Any],
    family: type,
    name: str,
    expected: str = "",
    fits: Callable[[Any], bool] = lambda _result: True,
) -> Callable[..., Any]:
    where = f"the task family {getattr(family, 'family', family.__name__)!r} ({family.__module__})"

    @wraps(method)
    def call(*args: Any, **options: Any) -> Any:
        try:
            result = method(*args, **options)
        except AgentflowError:
            raise
        except _Endless:
            raise PluginError(
                f"{where} failed: {name} has not returned within {PATIENCE:g} s"
            ) from None
        except Exception as error:
            what = f"{type(error).__name__}: {error}"
            raise PluginError(f"{where} failed: {name} raised {what}") from error
        if not fits(result):
            raise PluginError(f"{where} failed: {name} returned {result!r:.80}, not {expected}")
        return result

    return call


class _Endless(Exception):
    """A method that has not returned in time."""


def _timed(method: Callable[..., Any]) -> Callable[..., Any]:
    """A method that raises `_Endless` in time; its thread cannot be ended and is left behind."""

    @wraps(method)
    def call(*args: Any, **options: Any) -> Any:
        result: Future[Any] = Future()
        Thread(
            target=_fulfil, args=(result, partial(method, *args, **options)), daemon=True
        ).start()
        if not wait([result], PATIENCE).done:
            raise _Endless
        return result.result()

    return call


def _fulfil(result: Future[Any], work: Callable[[], Any]) -> None:
    try:
        result.set_result(work())
    except BaseException as error:  # noqa: BLE001 - raised where the result is awaited
        result.set_exception(error)


def _with_guarded_referee(method: Callable[..., Any], family: type) -> Callable[..., Any]:
    """The method, whose referees raise PluginError for their faults."""

    @wraps(method)
    def call(*args: Any, **options: Any) -> Any:
        referee = method(*args, **options)
        expected = "a Verdict with finite numbers"
        return SimpleNamespace(
            start=_guarded(referee.start, family, "referee.start"),
            watch=_guarded(referee.watch, family, "referee.watch"),
            verdict=_guarded(referee.verdict, family, "referee.verdict", expected, _is_verdict),
        )

    return call


def _is_verdict(result: Any) -> bool:
    if not isinstance(result, Verdict) or not _is_number(result.score):
        return False
    terms = dict(result.terms).values()
    return all(term is None or isinstance(term, str | bool) or _is_number(term) for term in terms)


def _is_number(value: Any) -> bool:
    return isinstance(value, float | int) and not isinstance(value, bool) and isfinite(value)


def _is_referee(result: Any) -> bool:
    return all(callable(getattr(result, name, None)) for name in ("start", "watch", "verdict"))


_RESULTS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "brief": ("a Brief", lambda result: isinstance(result, Brief)),
    "scene": ("a Scene", lambda result: isinstance(result, Scene)),
    "trials": ("a tuple of tasks", lambda result: isinstance(result, tuple) and bool(result)),
    "referee": ("an object with start, watch and verdict", _is_referee),
    "feedback": (
        "a Feedback with a text",
        lambda result: isinstance(result, Feedback) and isinstance(result.text, str),
    ),
}
"""Method of a task -> what it returns, in words and as a check."""

"""Sweeps as Python programs write them: configuration keys with one value, or with several."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from agentflow.config.run import set_key
from agentflow.errors import ConfigError

ANSWER = "answer"
"""Axis whose values are functions in place of models."""
METRICS = ("valid", "mean", "max", "verified")


def sweep_document(grid: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Callable[..., Any]]]:
    """The document of a sweep, and the function of each label of the axis `answer`.

    Args:
        grid: A document as in YAML files; or keys of the configuration and knobs, each with a value
            for all runs, with a list of values, or with a mapping of labels to settings.

    Raises:
        ConfigError: An axis has no values, or two functions have the same name.
    """
    if "axes" in grid or "table" in grid:
        return dict(grid), {}
    base: dict[str, Any] = {}
    axes: dict[str, Any] = {}
    functions = _functions(grid.get(ANSWER))
    for key, value in grid.items():
        if key == ANSWER:
            axes[key] = {label: {"model.name": label} for label in functions}
        elif isinstance(value, Sequence) and not isinstance(value, str):
            axes[key] = list(value)
        elif isinstance(value, Mapping) and all(isinstance(s, Mapping) for s in value.values()):
            axes[key] = dict(value)
        else:
            base = set_key(base, key, value)
    title = f"Runs by {', '.join(axes)}" if axes else "Runs"
    table = {"metrics": list(METRICS)}
    return {"title": title, "base": base, "axes": axes, "table": table}, functions


def _functions(given: Any) -> dict[str, Callable[..., Any]]:
    """The functions of the axis `answer`, by label."""
    if given is None:
        return {}
    if isinstance(given, Mapping):
        return {str(label): function for label, function in given.items()}
    items = list(given) if isinstance(given, Sequence) else [given]
    named = {function_name(function): function for function in items}
    if len(named) < len(items):
        raise ConfigError(
            "two functions of answer have the same name: write {label: function, ...} in place of "
            "a list"
        )
    return named


def function_name(function: Callable[..., Any]) -> str:
    """The name of a function in results."""
    return getattr(function, "__name__", type(function).__name__)

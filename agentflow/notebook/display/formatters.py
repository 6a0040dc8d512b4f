"""Tells IPython how to show things. Light: what draws is imported when something is shown.

The classes themselves know nothing of it, so that machines and rollouts need no notebook.
"""

import sys
from collections.abc import Callable
from importlib import import_module
from typing import Any

SHOWN = {
    "agentflow.machine.tree": ("Machine",),
    "agentflow.machine.validity": ("Report",),
    "agentflow.env.rollout": ("Rollout",),
    "agentflow.env.verification": ("Verification",),
    "agentflow.notebook.recorded": ("Run", "Sweep"),
    "agentflow.app.tasks": ("TaskInfo",),
}
"""Module -> classes that are shown as HTML."""


def install() -> None:
    """Have the running IPython, if there is one, show the classes of `SHOWN`."""
    shell = _shell()
    if shell is None:
        return
    formatters = shell.display_formatter.formatters
    for module, names in SHOWN.items():
        for name in names:
            formatters["text/html"].for_type_by_name(module, name, _drawing("to_html"))
    formatters["text/html"].for_type_by_name("agentflow.api", "Design", _drawing("design_html"))
    formatters["image/png"].for_type_by_name(
        "agentflow.machine.tree", "Machine", _drawing("to_png")
    )


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook, where displays can be updated."""
    return getattr(_shell(), "kernel", None) is not None


def _shell() -> Any:
    """The running IPython; None if there is none."""
    return sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None


def _drawing(name: str) -> Callable[[Any], Any]:
    return lambda shown: getattr(import_module("agentflow.notebook.display.html"), name)(shown)

"""What docstrings say of functions and their arguments."""

from __future__ import annotations

import pytest

from agentflow.cli.root import Documented
from agentflow.docstrings import split_docstring

TEXT = """Draw a machine.

In colour.

Args:
    size: Width and height: both
        in pixels.
    out: The file."""


def test_a_docstring_is_a_description_and_arguments() -> None:
    about, told = split_docstring(TEXT)
    assert about == "Draw a machine.\n\nIn colour."
    assert told == {"size": "Width and height: both in pixels.", "out": "The file."}
    assert split_docstring("Draw a machine.") == ("Draw a machine.", {})


def test_an_option_that_nothing_describes_is_an_error() -> None:
    class Option:
        name, help, secondary_opts = "colour", None, ("--no-colour",)

    with pytest.raises(KeyError, match="colour"):
        Documented("draw", params=[Option()], help=TEXT)

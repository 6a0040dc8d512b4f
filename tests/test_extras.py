from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest

from agentflow.errors import ConfigError
from agentflow.extras import DISTRIBUTION, install, is_installed, missing, needs_extra

PROJECT = (Path(__file__).parent.parent / "pyproject.toml").read_text(encoding="utf-8")


def test_an_extra_is_installed_by_the_name_of_the_distribution() -> None:
    assert f'name = "{DISTRIBUTION}"\n' in PROJECT
    assert install("mcp") == f"pip install '{DISTRIBUTION}[mcp]'"


def test_a_missing_library_is_told_with_its_extra_or_alone() -> None:
    assert str(missing("a", "mcp")) == f"a is not installed; install it with: {install('mcp')}"
    assert str(missing("a")) == "a is not installed; install it with: pip install a"
    assert (is_installed("pytest"), is_installed("no_such_library")) == (True, False)


@pytest.mark.parametrize(("apart", "how"), [((), install("x")), (("no_such",), "install no_such")])
def test_an_import_that_fails_names_what_to_install(apart: tuple[str, ...], how: str) -> None:
    with (
        pytest.raises(ConfigError, match=f"^no_such is not installed; .*{re.escape(how)}$"),
        needs_extra("x", *apart),
    ):
        import_module("no_such.module")

"""Warnings of other libraries fail no test."""

from __future__ import annotations

import pytest

LIBRARIES = "accelerate|datasets|gensim|multiprocess|peft|torch|transformers|trl"


def pytest_configure(config: pytest.Config) -> None:
    """Warnings are errors, but not those about code of these libraries."""
    config.addinivalue_line("filterwarnings", rf"ignore::Warning:({LIBRARIES})(\.|$)")

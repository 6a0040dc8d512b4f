"""Owns how prompts are rendered: one pass, strict, and named by a content hash."""

from __future__ import annotations


class PromptSet:
    """A named folder of templates."""

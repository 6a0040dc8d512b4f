"""Prompt sets: Jinja templates by role, and the renderer that never renders text twice."""

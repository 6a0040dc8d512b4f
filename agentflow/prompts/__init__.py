"""Prompt sets: Jinja templates by role, rendered strictly and only once."""

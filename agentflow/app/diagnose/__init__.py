"""Diagnostics: what a model knows of the geometry and motion of machines that it did not build."""

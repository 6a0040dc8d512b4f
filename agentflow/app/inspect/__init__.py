"""Inspecting recorded runs: list, details, machines, failures."""

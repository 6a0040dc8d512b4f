"""Sweeps: cost estimates, folders, execution, tables."""

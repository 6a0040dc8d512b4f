"""Typed configuration: runs, sweeps, YAML files."""

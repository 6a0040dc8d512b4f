"""Machines in the file formats of other simulators."""

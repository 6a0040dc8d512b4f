"""Workflows: plain control flow over roles, one file each, all yielding the same record."""

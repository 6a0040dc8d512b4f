"""Workflows: plain control flow over roles, one module each, all with the same result."""

"""Wires everything together, with one folder or module per user action."""

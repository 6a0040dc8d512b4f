"""Wires everything together: one folder or module per thing that a user can do."""

"""Wires everything together, with one folder or module per thing that a user can do."""

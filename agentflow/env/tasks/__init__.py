"""The tasks: one module per family, levels as data."""

"""Single machines from files: checked, edited, converted, simulated."""

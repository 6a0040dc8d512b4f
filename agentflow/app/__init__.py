"""The only place that wires everything: one module per thing that a user can do."""

"""Controllers of machines: what they sense, by which laws, and which blocks follow."""

"""Forces that engines do not compute themselves: air, flight, springs and winches."""
